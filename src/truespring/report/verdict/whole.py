"""The verdict as a whole: trouble first, then agreement; of a motion also its separate errors."""

from truespring.report.result import Result
from truespring.report.verdict.agreement import agreement_sentences
from truespring.report.verdict.alone import alone_sentences
from truespring.report.verdict.motion import integration_dominates, motion_sentences
from truespring.report.verdict.trouble import trouble_sentences


def verdict(result: Result) -> str:
    """Return the verdict as one text."""
    return " ".join(verdict_sentences(result))


def verdict_sentences(result: Result) -> tuple[str, ...]:
    """Return the verdict in sentences: trouble of the models, then where the model agrees with which reference.

    The errors of a motion follow; they come first if that of step or solver is above the tolerance: agreement of two
    models is then no evidence of accuracy.
    """
    compared = result.model is not None and bool(result.comparisons)
    found = list(agreement_sentences(result) if compared else alone_sentences(result))
    motion = list(motion_sentences(result))
    several = [motion, found] if integration_dominates(result) else [found, motion]
    return tuple(_capital(sentence) for sentence in (*trouble_sentences(result), *several[0], *several[1]))


def _capital(sentence: str) -> str:
    if "." in sentence.split(" ")[0]:  # the name of a file
        return sentence
    return sentence[:1].upper() + sentence[1:]

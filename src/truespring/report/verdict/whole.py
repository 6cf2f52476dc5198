"""The verdict as a whole: trouble first, then agreement."""

from truespring.report.result import Result
from truespring.report.verdict.agreement import agreement_sentences
from truespring.report.verdict.alone import alone_sentences
from truespring.report.verdict.trouble import trouble_sentences


def verdict(result: Result) -> str:
    """Return the verdict as one text."""
    return " ".join(verdict_sentences(result))


def verdict_sentences(result: Result) -> tuple[str, ...]:
    """Return the verdict in sentences: trouble of the models, then where the model agrees with which reference."""
    compared = result.model is not None and bool(result.comparisons)
    found = agreement_sentences(result) if compared else alone_sentences(result)
    return tuple(_capital(sentence) for sentence in (*trouble_sentences(result), *found))


def _capital(sentence: str) -> str:
    if "." in sentence.split(" ")[0]:  # the name of a file
        return sentence
    return sentence[:1].upper() + sentence[1:]

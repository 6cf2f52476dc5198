"""Springs of this commit and of an older one, in alternation, in the same environment."""

import io
import subprocess
import tarfile
from pathlib import Path

from benchmarks.cases import OLDER
from benchmarks.runs import CACHE, HERE, PROGRAMS, REPEATS, ROOT, SPRINGS, Job, Session, digest, execute

#: The commit that figures are compared with, and the springs that it was measured with, by dimension.
COMMIT, RULES = "8b0afef", {3: "isotropic", 2: "lloyd"}


def source() -> Path | None:
    """Return the folder of truespring's source at COMMIT, in the cache; None if the clone does not have it."""
    folder = CACHE / COMMIT
    if not (folder / "src").is_dir():
        packed = subprocess.run(["git", "archive", COMMIT, "src"], cwd=ROOT, capture_output=True, check=False)
        if packed.returncode:
            return None
        with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
            archive.extractall(folder, filter="data")
    return folder / "src"


def compared(session: Session, depths: dict[int, int] = OLDER, repeats: int = REPEATS) -> list[dict]:
    """Return the times [s] of springs then and now by dimension, also of Gaussian springs now; none without COMMIT."""
    before = source()
    if before is None:
        session.log(f"older commit {COMMIT}: not in this clone, not measured")
        return []
    own = [HERE / "older.py", HERE / "cases.py", *sorted((HERE / "programs").glob("*.py"))]
    found = []
    for dim, rule in RULES.items():
        depth, then = depths[dim], Job(rule, dim, "bending", depths[dim])
        sides = {"then": (then, before), "now": (then, ROOT / "src"), SPRINGS: (Job(SPRINGS, dim, "bending", depth),)}
        times: dict[str, list[float]] = {side: [] for side in sides}
        row = {"dim": dim, "n_nodes": then.n_nodes, "rule": PROGRAMS[rule].label, "failure": "", "seconds": times}
        for turn in range(repeats):
            for side, arguments in sides.items():
                code = digest(f"{COMMIT} {side}", own, ours=side != "then")
                one = session.cached(
                    f"older-{dim}d-{depth}-{side}-{turn}", code, lambda given=arguments: execute(*given)
                )
                row["failure"] = row["failure"] or one.get("failure", "")
                times[side] += [one["seconds"]] if "seconds" in one else []
                session.log(
                    f"older commit: {dim}D {then.n_nodes:,} nodes, {side}: {one.get('seconds', one.get('failure'))}"
                )
        found.append(row)
    return found

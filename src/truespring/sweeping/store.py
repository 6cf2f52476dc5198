"""Records of points, each whole or not there at all, however the process ends that writes them."""

import json
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from truespring.outputs import write_whole

# What a killed process left half written is of no use after so long [s].
_STALE = 3600.0


class Store:
    """The records in OUT/points: NAME.json for each point that was solved or failed."""

    def __init__(self, out: Path) -> None:
        """Make the folder where there is none; raise OSError where it cannot be."""
        self.folder = out / "points"
        self.folder.mkdir(parents=True, exist_ok=True)
        for left in self.folder.glob(".*.tmp"):
            if time.time() - left.stat().st_mtime > _STALE:
                left.unlink(missing_ok=True)

    def write(self, record: Mapping[str, Any]) -> None:
        """Keep the record of the point that its `point` names."""
        text = json.dumps(record, indent=1, allow_nan=False)
        write_whole(self.folder / f"{record['point']}.json", f"{text}\n".encode())

    def read(self) -> Iterator[dict[str, Any]]:
        """Yield all records; what is none is passed over, and written anew by who solves its point."""
        for file in sorted(self.folder.glob("*.json")):
            try:
                record = json.loads(file.read_text(encoding="utf-8"))
            except (OSError, ValueError):
                continue
            if isinstance(record, dict) and record.get("point") == file.stem and record.get("status") in STATUSES:
                yield record


CONVERGED, FAILED = "converged", "failed"
STATUSES = (CONVERGED, FAILED)

"""Measure the paper's Table 1 and write docs/table1.md, docs/table1.json and the pictures."""

import json
from pathlib import Path

from truespring.table1 import measure_table, page
from truespring.table1.figure import files

DOCS = Path(__file__).parent


def main() -> None:
    table = measure_table(progress=lambda what, share: print(f"{share:4.0%}  {what}", flush=True))
    (DOCS / "table1.json").write_text(json.dumps(table, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    figures = {dim: f"images/table1_{dim}d.svg" for dim in (2, 3)}
    for dim, place in figures.items():
        (DOCS / place).write_bytes(files(table, dim)[1])
    (DOCS / "table1.md").write_text(page(table, figures), encoding="utf-8")


if __name__ == "__main__":
    main()

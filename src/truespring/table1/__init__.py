"""Table 1 of Lembryk and Ciszkiewicz, measured: six methods, one body, one solver."""

from truespring.table1.page import page as page
from truespring.table1.run import measure_table as measure_table
from truespring.table1.write import write_table as write_table

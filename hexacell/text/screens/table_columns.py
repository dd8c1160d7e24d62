"""The columns of the tables, apart from what is in them: the tables are made before that is loaded."""

from hexacell.text.screens.views import Column

RECORD_COLUMNS = (
    Column("pose", 8),
    *(Column(name, 8, is_figure=True) for name in ("x mm", "y mm", "z mm", "off mm")),
    Column("sigma", 8, is_figure=True),
)
"""``off`` is the largest of x, y and z less what the fit says, before it less what was predicted; ``sigma``
its ratio to the noise."""

PARAMETER_COLUMNS = (
    Column("parameter", 13),
    *(Column(name, 11, is_figure=True) for name in ("config now", "new config", "changed by")),
    Column("sigma", 7, is_figure=True),
    Column("  meaning", 24),
)

RUN_COLUMNS = (
    Column("run", 20),
    Column("what", 12),
    Column("verdict", 18),
    Column("error ± U, mm", 15),
    Column("controller", 13),
)

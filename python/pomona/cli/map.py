"""`pomona map ...`: the orchard map, one identity for each fruit over all visits."""

from pomona.cli.map_add import map_add
from pomona.cli.map_check import map_check
from pomona.cli.map_georeference import map_georeference
from pomona.cli.map_info import map_info
from pomona.cli.map_merge import map_merge
from pomona.cli.map_remove import map_remove
from pomona.cli.map_team import map_pull, map_push
from pomona.cli.map_trees import map_trees
from pomona.cli.verbs import Verbs

app = Verbs(help="Keep an orchard map: one identity for each fruit over all visits.", no_args_is_help=True)


@app.callback()
def _map() -> None:
    """Keep an orchard map: one identity for each fruit over all visits."""


app.command("add")(map_add)
app.command("remove")(map_remove)
app.command("merge")(map_merge)
app.command("trees")(map_trees)
app.command("georeference")(map_georeference)
app.command("info")(map_info)
app.command("check")(map_check)
app.command("push")(map_push)
app.command("pull")(map_pull)

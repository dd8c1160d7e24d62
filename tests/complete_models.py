"""Models whose fields hypothesis sees: the program builds each when it is used first."""

from hexacell.cell.fields import Frozen


def complete(model: type[Frozen] = Frozen) -> None:
    """Build the models of records that nobody has used yet."""
    for one in model.__subclasses__():
        one.model_rebuild()
        complete(one)

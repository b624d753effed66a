"""The ladder of a comparison, as the command compare adds it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from hopopt.errors import HopoptError

if TYPE_CHECKING:
    from hopopt.comparison.compare import Comparison
    from hopopt.comparison.hops.hop_after_hop import HopsComparison
    from hopopt.comparison.ladder import Ladder


def ladder_of(
    found: "Comparison | HopsComparison", data: dict[str, Any], say: Callable[[str], None]
) -> "Ladder | None":
    """The ladder of a comparison, and its entries in the data; a note where there is none, for all else is found."""
    from hopopt.comparison.ladder import ladder

    try:
        steps = ladder(found, say)
    except HopoptError as error:
        data["notes"].append(str(error))
        return None
    data |= steps.as_dict()
    return steps

"""A global method on the whole stance of legs of two joints: dynamic programming on a grid of states, and stances that
differ, followed from the start under its guidance."""

from hopopt.global_search.applicability import applies, left_out
from hopopt.global_search.result import GlobalSearch, Rollout
from hopopt.global_search.search import search

__all__ = ["GlobalSearch", "Rollout", "applies", "left_out", "search"]

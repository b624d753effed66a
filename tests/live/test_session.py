"""What a page is told while numbers are dragged: never the hop of other numbers than those that stand there."""

import asyncio
import random
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from hopopt import load
from hopopt.errors import UsageError
from hopopt.live import session as module
from hopopt.live.bench import IMPOSSIBLE, PRELIMINARY, Found, Learnt
from hopopt.live.desk import Verified
from hopopt.live.processes import beside
from hopopt.live.processes.worker import Failed, Stopped
from hopopt.live.session import Session
from hopopt.live.sliders import added_mass, named
from hopopt.live.tried import MOST_DESIGNS

ENTRIES = ["leg.gear.ratio", "leg.body.mass"]
FIGURES: Mapping[str, float | None] = {"mass_kg": 8.0, "peak_power_W": 100.0, "lowest_voltage": None}


class Workers:
    """In place of other processes: a bench that takes a while, a desk that takes longer."""

    bench_s, desk_s, sound, better, broken = 0.004, 0.02, True, False, False

    def __init__(self, make: Callable[..., Any], say: Callable[[str], None]):
        self.stopped, self.desk = asyncio.Event(), "desk" in repr(make)

    async def ask(self, method: str, *given: Any) -> Any:
        if self.stopped.is_set():
            raise Stopped
        waits = asyncio.create_task(self.stopped.wait())
        ended, _ = await asyncio.wait({waits}, timeout=self.desk_s if self.desk else self.bench_s)
        waits.cancel()
        if ended:
            raise Stopped
        return getattr(self, method)(*given)

    def stop(self) -> None:
        self.stopped.set()

    def begin(self, processes: int | None) -> Any:
        sliders = named(load("paper"), ENTRIES)
        return sliders, self.at({s.entry: s.value for s in sliders})

    def at(self, values: Mapping[str, float]) -> Found:
        if values["leg.gear.ratio"] > 150:
            return Found(IMPOSSIBLE, "the pose cannot be held")
        return Found(PRELIMINARY, value=value_of(values), figures=FIGURES, picture={"of": dict(values)})

    def value_at(self, values: Mapping[str, float]) -> float:
        return value_of(values)

    def choose(self, choices: Mapping[str, str]) -> Any:
        return [
            s.about(75.0 if choices and s.entry == "leg.gear.ratio" else s.value) for s in named(load("paper"), ENTRIES)
        ]

    def verify(self, entries: Mapping[str, Any], found: Found) -> Verified:
        if self.broken:
            raise Failed("no memory is left")
        if not self.sound:
            return Verified(False, ("replay",), None, FIGURES, {})
        return Verified(True, (), (found.value or 0.0) + 0.001, FIGURES, found.picture or {}, "folder")

    def search(self, entries: Mapping[str, Any]) -> Any:
        return {1: None}, ("another way",)

    def learn(self, values: Mapping[str, float], families: Any, words: Any) -> Learnt:
        return Learnt(self.better, int(self.better))

    def leave(self, *methods: str) -> None: ...

    def write(self, entries: Mapping[str, Any]) -> str:
        raise Failed("the disk is full")

    def report(self, folder: str) -> str:
        return f"{folder}/report.html"


def value_of(values: Mapping[str, float]) -> float:
    return 0.008 * values["leg.gear.ratio"] - 0.01 * values["leg.body.mass"]


def explored(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, hands: Callable[[Session], Any], rest: float = 0.01
) -> tuple[list[dict[str, Any]], Session]:
    """All states that are told while ``hands`` drag."""
    monkeypatch.setattr(module, "Worker", Workers)
    monkeypatch.setattr(beside, "Worker", Workers)
    monkeypatch.setattr(module, "REST", rest)
    told = list[dict[str, Any]]()

    async def main() -> Session:
        s = Session(load("paper"), "clearance", ENTRIES, tmp_path, tell=lambda state: told.append(state))
        task = asyncio.create_task(s.run())
        while s.found is None:
            await asyncio.sleep(0.001)
        await hands(s)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return s

    return told, asyncio.run(main())


async def settled(s: Session) -> None:
    """Until what was asked last is looked at closely."""
    async with asyncio.timeout(20):
        while s.state["stale"] or s.state["now"]["word"] == PRELIMINARY:
            await asyncio.sleep(0.01)


def test_the_last_of_many_drags_is_answered_and_then_verified(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    async def hands(s: Session) -> None:
        for ratio in range(60, 100):
            s.set({"leg.gear.ratio": float(ratio)})
            await asyncio.sleep(0.001)
        await settled(s)

    told, s = explored(monkeypatch, tmp_path, hands)
    words = [
        state["now"]["word"]
        for state in told
        if "now" in state and state["values"].get("leg.gear.ratio") == 99.0 and not state["stale"]
    ]
    assert words[0] == "preliminary"
    assert words[-1] == "verified"
    assert s.state["now"]["value"] == pytest.approx(value_of(s.asked.values) + 0.001)
    assert [t.asked.values["leg.gear.ratio"] for t in s.designs.tried][-1] == 99.0


def test_no_number_stands_under_sliders_that_it_does_not_belong_to(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """200 random drags, rests, undos and choices: whatever is not called stale is of the values that stand there."""
    rng = random.Random(1)

    async def hands(s: Session) -> None:
        for _ in range(200):
            act = rng.random()
            if act < 0.8:
                s.set({"leg.gear.ratio": rng.uniform(50, 200)} if act < 0.5 else {"leg.body.mass": rng.uniform(3, 11)})
            elif act < 0.86:
                s.undo()
            elif act < 0.9:
                s.fill_map(rng.choice([["leg.body.mass"], ENTRIES, []]))
            elif s.designs.tried:
                s.back_to(rng.choice(s.designs.tried).id)
            await asyncio.sleep(rng.choice([0.0, 0.001, 0.012]))
        s.set({"leg.gear.ratio": 81.0})
        await settled(s)

    told, s = explored(monkeypatch, tmp_path, hands, rest=0.008)
    for state in (state for state in told if state.get("now") and not state["stale"]):
        now, values = state["now"], state["values"]
        if now["outcome"] == PRELIMINARY:
            assert now["value"] == pytest.approx(value_of(values), abs=0.0011)
            assert state["picture"]["of"] == values
    assert len(s.designs.tried) <= MOST_DESIGNS
    assert {state["now"]["word"] for state in told if state.get("now")} >= {"preliminary", "verified", IMPOSSIBLE}


def test_an_impossible_design_says_why_and_keeps_the_last_hop(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    async def hands(s: Session) -> None:
        await settled(s)
        s.set({"leg.gear.ratio": 180.0})
        await settled(s)

    _, s = explored(monkeypatch, tmp_path, hands)
    assert s.state["now"]["sentence"] == "the pose cannot be held"
    assert s.state["now"]["value"] is None
    assert s.state["picture"]["of"]["leg.gear.ratio"] == 100.0
    assert len(s.designs.tried) == 1


def test_a_hop_that_fails_its_checks_is_called_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(Workers, "sound", False)
    _, s = explored(monkeypatch, tmp_path, settled)
    assert s.state["now"]["word"] == "not verified"
    assert s.state["now"]["sentence"] == "failed checks: replay"


def test_a_verification_that_breaks_off_changes_the_word_and_says_why(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(Workers, "broken", True)
    _, s = explored(monkeypatch, tmp_path, settled)
    assert s.state["now"]["word"] == "not verified"
    assert s.state["now"]["sentence"].endswith("no memory is left")


def test_a_report_that_was_asked_for_is_made_whatever_is_dragged_next(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    async def hands(s: Session) -> None:
        s.orders.report()
        for ratio in range(60, 90):
            await asyncio.sleep(0.003)
            s.set({"leg.gear.ratio": float(ratio)})
        async with asyncio.timeout(20):
            while "report.html" not in s.said:
                await asyncio.sleep(0.01)

    _, s = explored(monkeypatch, tmp_path, hands)
    assert s.designs.tried[0].verified is not None
    assert s.designs.tried[0].asked.values["leg.gear.ratio"] == 100.0


def test_a_part_of_the_catalogue_brings_its_numbers_and_undo_takes_them_back(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    async def hands(s: Session) -> None:
        await settled(s)
        s.set({"leg.gear.ratio": 90.0, "leg.body.mass": 6.0})
        await settled(s)
        s.choose("leg.gear", s.parts["leg.gear"][0])
        await settled(s)
        heavier = added_mass(load("paper"), s.asked.choices)
        assert s.asked.values == {"leg.gear.ratio": 75.0, "leg.body.mass": 6.0 + heavier}
        s.undo()
        await settled(s)

    _, s = explored(monkeypatch, tmp_path, hands)
    assert s.asked.values == {"leg.gear.ratio": 90.0, "leg.body.mass": 6.0}
    assert s.state["chosen"]["leg.gear"] == ""


def test_a_map_fills_in_and_goes_when_other_entries_change(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    async def hands(s: Session) -> None:
        s.fill_map(["leg.gear.ratio"])
        while s.state["map"]["left"]:
            await asyncio.sleep(0.01)
        (axis,) = s.state["map"]["axes"]
        for cell in s.state["map"]["cells"]:
            assert cell["value"] == pytest.approx(value_of({**s.asked.values, "leg.gear.ratio": axis[cell["at"][0]]}))
        s.set({"leg.gear.ratio": 70.0})
        assert s.map is not None
        s.set({"leg.body.mass": 4.0})
        assert s.map is None

    explored(monkeypatch, tmp_path, hands)


def test_what_cannot_be_done_is_a_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    async def hands(s: Session) -> None:
        s.orders.write()
        while not s.said:
            await asyncio.sleep(0.01)
        refused = [
            lambda: s.set({"leg.gear.rato": 1.0}), lambda: s.set({"leg.gear.ratio": 1e9}), lambda: s.back_to(99),
            lambda: s.choose("leg.motor", "no-such"), lambda: s.choose("leg.body", "x"), lambda: s.fill_map(["leg.gear.ratio"] * 2),
        ]  # fmt: skip
        for ask in refused:
            with pytest.raises(UsageError):
                ask()

    told, _ = explored(monkeypatch, tmp_path, hands)
    assert "the disk is full" in [state.get("said") for state in told]


def test_a_better_family_that_a_search_finds_is_switched_to_and_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(Workers, "better", True)

    async def hands(s: Session) -> None:
        async with asyncio.timeout(20):
            while "better kind of hop" not in s.said:
                await asyncio.sleep(0.01)
        await settled(s)

    _, s = explored(monkeypatch, tmp_path, hands)
    assert s.state["now"]["word"] == "verified"
    assert len(s.designs.tried) == 1

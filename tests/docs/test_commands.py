"""Every command that README and the pages of docs show is one; those of some pages are run on the paper's leg, those of
README in tests/cli."""

import json
import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

import hopopt as ho
from hopopt.cli.main import WITH, app, run
from hopopt.sim.hop_metrics import HopFigures

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SMALLER = {  # sizes for a test: the same command on fewer points
    r"(=[\d.]+:[\d.]+):(11|9|7|5)\b": r"\1:2", r"\b(lhs|sobol):40": r"\1:3", "60,80,100": "80,100", "--points 8": "--points 3",
    "--draws 50": "--draws 2", "--starts 100 --global": "--starts 2", "--tune 60": "--tune 24",
    "--processes 4": "--processes 2",
}  # fmt: skip
ONE_START = ("solve", "sweep", "pareto", "transition")  # those are solved from a single start
SHORT = ["--set", "hop.stance_duration=[0.03, 0.2]"]  # few intervals, where the page asks for no other stance
FEW = ["--share", "0.5", "--confidence", "0.5", "--draws", "4", "--evaluations", "1", "--starts", "1"]  # for robust
RUN = ("own_leg",)  # pages that are run whole, in half a minute; with HOPOPT_PAGES=all every page is, in an hour
ALL = os.environ.get("HOPOPT_PAGES") == "all"
REFUSED = {  # exit codes of commands of which the page says so
    "pareto --against impact": 2,  # there is no such front
    "repair results/paper-0a1b2c3d": 2,  # nothing was changed
    "repair RESULT": 2,
    "solve --set 'hop.stance_duration=[0.01,0.02]' --objective time --set hop.clearance=0.4": 1,  # no hop, and why
}
STORED = re.compile(r"results/\w+-\w{8}")
NEEDS = {"--mujoco": "mujoco", "--scheduler": "distributed"}  # extras
NAMES = {"[PROBLEM]": "paper", "PROBLEM": "paper", "FILE": "paper", "my_leg.toml": "my_leg.toml"}


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.S | re.M)


def commands(page: Path) -> list[list[str]]:
    """The words of every command, in blocks and in sentences, without "hopopt"; a sentence's bare names are none."""
    lines = [line for block in blocks(page, "sh") for line in block.replace("\\\n", " ").splitlines()]
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    lines += re.findall(r"`(hopopt [^\s`]+ [^`]+)`", text.replace("\n", " "))
    found = [shlex.split(line.partition(" > ")[0], comments=True)[1:] for line in lines if line.startswith("hopopt ")]
    return [[NAMES.get(word, word) for word in words] for words in found]


def test_there_are_commands_to_look_at() -> None:
    assert sum(len(commands(page)) for page in PAGES) > 50


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_is_one(page: Path) -> None:
    """With its options; a misspelt one would end the test by its own error. ``--with`` goes with every command, before that."""
    for words in commands(page):
        own = [k for k, word in enumerate(words) if word == WITH]
        kept = [word for k, word in enumerate(words) if k not in own and k - 1 not in own]
        app.parse_args(kept, exit_on_error=False, print_error=False)


def results_for(words: list[str], folder: Path) -> Iterator[str]:
    """The words, with a folder in place of one that stands for any: one found with the same constraints, or a study."""
    given = [words[k + 1] for k, word in enumerate(words) if word == "--constraint"]
    for word in words:
        if word == "FOLDER" or "sweep-" in word:
            yield str(max(folder.glob("results/*-sweep-*"), key=lambda path: path.stat().st_mtime))
        elif "comparison-" in word:
            yield str(next(folder.glob("results/*-comparison-*")))
        elif word == "RESULT" or STORED.fullmatch(word):
            kept = [
                json.loads(path.read_text()) | {"at": path.parent} for path in folder.glob("results/*/summary.json")
            ]
            usable = (s for s in kept if s["functions"] == {"objective": None, "constraints": given} and "phases" in s)
            suits = (s for s in usable if words[0] != "transition" or s["hop"] == "periodic")
            yield str(next(suits)["at"])
        else:
            yield word


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES if (ALL and page.stem != "README") or page.stem in RUN], ids=lambda page: page.name
)
def test_every_command_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for name, other in (("mine", "objectives"), ("push", "own_controller")):
        (tmp_path / f"{name}.py").write_text(blocks(ROOT / "docs" / f"{other}.md", "python")[0])
    run(["new", "my_leg"])
    own = "part,name,max_torque,max_speed\nmotor,mine,2.0,400\n"
    (tmp_path / "my.csv").write_text(own)
    if any(word in ("RESULT", "FILE") or STORED.fullmatch(word) for words in commands(page) for word in words):
        assert run(["solve", "--starts", "1", "--no-figures"]) == 0
    if "comparison-" in page.read_text(encoding="utf-8"):
        assert run(["compare", "--strategies", "force", "--no-figures", "--set", "solver.starts=1"]) == 0
    if page.stem == "report":
        assert run(["sweep", "--vary", "leg.gear.ratio=100,110", "--starts", "1", "--no-figures"]) == 0
    for words in commands(page):
        if shlex.join(words) in REFUSED:
            assert run(words) == REFUSED[shlex.join(words)]
            capfd.readouterr()
            continue
        if (
            words[0] in ("new", "log", "identify", "view", "explore", "choose")
            or {"obstacle", "--cross-check"} & {*words}
            or (words[0] == "compare" and "periodic" in words)
        ):
            continue  # done already, or expensive, or of a file that is not there, and tried elsewhere; a view or a live page never ends
        for option, module in NEEDS.items():
            if option in words:
                pytest.importorskip(module)
        line = shlex.join(results_for(words, tmp_path))
        for size, less in SMALLER.items():
            line = re.sub(size, less, line)
        more = ["--starts", "1", "--no-figures"] if words[0] in ONE_START and "--resume" not in words else []
        more += SHORT if words[0] in ("solve", "pareto") and "stance" not in line else []
        more = FEW if words[0] == "robust" else more
        if words[0] in ("compare", "sensitivity") and not {"--bound", "--result"} & {*words}:
            more = ["--set", "solver.starts=1"]
        assert run([*shlex.split(line), *more]) == 0, f"{line}\n{capfd.readouterr()}"
        capfd.readouterr()


@pytest.mark.slow
def test_the_controller_of_the_page_hops_and_folds_at_lift_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It rises on its own push; after lift-off its knee is folded further than when it left."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "push.py").write_text(blocks(ROOT / "docs" / "own_controller.md", "python")[0])
    found: HopFigures = ho.simulate("paper", "push:PushThenTuck", options={"push": 300.0}).figures
    assert found.clearance > 0.45
    trace, left = found.trace, found.lift_off["time_s"]
    assert left > 0.1
    at, later = (abs(trace.q[trace.t.searchsorted(t), -1]) for t in (left, left + 0.2))
    assert later > at + 0.5


def test_completion_is_installed_by_one_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the home of whoever runs it: a script that knows the commands."""
    assert "`hopopt --install-completion`" in (ROOT / "docs" / "own_leg.md").read_text(encoding="utf-8")
    for name, value in {"HOME": str(tmp_path), "SHELL": "/bin/bash"}.items():
        monkeypatch.setenv(name, value)
    assert run(["--install-completion", "--shell", "bash"]) == 0
    (script,) = tmp_path.rglob("completions/hopopt")
    assert {"solve", "compare", "sweep"} <= set(re.findall(r"\w+", script.read_text(encoding="utf-8")))

"""A module of the user's own with all that a researcher may add: found, kept, and read in other processes."""

import json
import shutil
from pathlib import Path

import pytest

from scripts import python

SCRIPT = Path(__file__).with_name("research_script.py")


@pytest.mark.slow
def test_an_answer_with_everything_of_ones_own_is_verified_in_another_process(tmp_path: Path) -> None:
    """Law, number, constraint, objective, gravity, slope, rate, Ipopt's option, guess; without the module, one sentence."""
    shutil.copy(SCRIPT, tmp_path)
    found = python("import research_script as r; s = r.find('results'); print(s.folder, s.verified)", tmp_path)
    assert found.returncode == 0, found.stderr
    folder, verified = found.stdout.split()
    assert verified == "True"
    again = python(f"import json, research_script as r; print(json.dumps(r.look('{folder}')))", tmp_path)
    assert again.returncode == 0, again.stderr
    data = json.loads(again.stdout)
    assert data["verified"], data["faults"]
    assert data["rates"]
    (tmp_path / SCRIPT.name).rename(tmp_path / "elsewhere.txt")
    words = (
        "import hopopt as ho\nfrom hopopt.errors import UsageError\n"
        f"print(ho.read('{folder}').clearance)\ntry:\n    ho.verify('{folder}')\nexcept UsageError as error:\n    print(error)"
    )
    without = python(words, tmp_path)
    assert without.returncode == 0, without.stderr
    clearance, said = without.stdout.splitlines()
    assert float(clearance) == data["clearance"]
    assert "needs research_script: add --with research_script, or import research_script in Python" in said

"""`gyrotwin diagnose --each`: files, resuming, data that are wrong."""

import json
from pathlib import Path

import jsonschema
import pytest

import gyrotwin as gt
from gyrotwin.cli import main
from gyrotwin.interrupt import Interrupted
from gyrotwin.tasks import fleet as task


@pytest.fixture(scope="module")
def wafer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wafer")
    for seed, k3 in enumerate((4e9, 0.0), 1):
        gt.simulate_dataset(folder / f"die-{seed}", hidden={"k3_x": k3, "k3_y": k3}, samples=1500, runs=2, seed=seed)
    (folder / "die-3").mkdir()
    (folder / "die-3" / "dataset.toml").write_text('format = 1\n[[run]]\nfile = "none.csv"\nsample_rate = 1e5\n')
    (folder / "devices.csv").write_text("die;x [mm]\ndie-1;0,5\ndie-2;1,5\ndie-3;2,5\n")
    return folder


def test_each_is_diagnosed_once_and_put_together(
    wafer: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as ended:
        main(["diagnose", "--each", str(wafer), "--out", str(out), "--max-effects", "1"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert "cubic_stiffness" in said
    assert "none.csv" in said
    report = json.loads((out / "fleet.json").read_text())
    jsonschema.validate(report, gt.schema("fleet"))
    assert report["devices"]["die-1"]["effects"] == ["cubic_stiffness"]
    assert report["devices"]["die-2"]["effects"] == []
    assert "none.csv" in report["devices"]["die-3"]["error"]
    assert report["columns"] == {"x [mm]": {"die-1": 0.5, "die-2": 1.5, "die-3": 2.5}}
    assert {path.name for path in (out / "devices" / "die-1").iterdir()} >= {"device.toml", "report.html", "row.json"}
    page = (out / "report.html").read_text()
    assert 'href="devices/die-1/report.html"' in page

    # The same again searches nothing; another option, or a row that was tampered with, does.
    searched = []
    monkeypatch.setattr(task.one, "find", lambda request, *rest: searched.append(request.dataset.name) or 1 / 0)
    found = gt.diagnose_each(wafer, out, max_effects=1)
    assert searched == []
    assert found.summary == report
    assert found.devices["device"].to_list() == ["die-1", "die-2", "die-3"]
    with pytest.raises(ZeroDivisionError):
        gt.diagnose_each(wafer, out, max_effects=2)
    row = out / "devices" / "die-2" / "row.json"
    row.write_text(row.read_text().replace('"value": ', '"value": "1e999", "x": '))
    with pytest.raises(ZeroDivisionError):
        gt.diagnose_each(wafer, out, max_effects=1)
    assert searched == ["die-1", "die-2"]


@pytest.mark.parametrize(
    ("text", "said"),
    [("die,x\ndie-1,1\ndie-2,2\n", "die-3"), ("die,x\ndie-1,1\ndie-1,2\ndie-2,1\ndie-3,1\n", "die-1"),
     ("die,x\ndie-1,1\ndie-2,left\ndie-3,1\n", "left")],
    ids=["missing", "twice", "no number"],
)  # fmt: skip
def test_a_table_that_does_not_fit_the_devices_is_refused(wafer: Path, tmp_path: Path, text: str, said: str) -> None:
    folder = tmp_path / "wafer"
    folder.mkdir()
    for die in wafer.glob("die-*"):
        (folder / die.name).symlink_to(die)
    (folder / "devices.csv").write_text(text)
    with pytest.raises(gt.InputError, match=said):
        gt.diagnose_each(folder, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_without_data_sets_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for place in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(SystemExit) as stop:
            main(["diagnose", "--each", str(place)])
        assert stop.value.code == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


def test_interrupted_it_says_what_is_kept(wafer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*arguments: object) -> None:
        raise Interrupted

    monkeypatch.setattr(task.one, "find", stop)
    with pytest.raises(Interrupted) as stopped:
        gt.diagnose_each(wafer, tmp_path / "out", max_effects=1)
    assert stopped.value.left.endswith("keeps what was found so far: the same command goes on from there")

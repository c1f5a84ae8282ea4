"""Benchmarks look at what they are given before they compute."""

import importlib

import pytest


def test_a_battery_without_scenes_ends_with_one_error(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("VTKMUSCLE_DATA", str(tmp_path))
    monkeypatch.setattr("sys.argv", ["battery.py", "--rst", str(tmp_path / "tables")])
    with pytest.raises(SystemExit, match="2"):
        importlib.import_module("battery").main()
    assert f"no scene in {tmp_path}; name a SCENE.toml" in capsys.readouterr().err
    assert not (tmp_path / "tables").exists()


def test_the_tables_of_trade_offs_have_a_folder_and_known_names(tmp_path, monkeypatch, capsys):
    page = importlib.import_module("tradeoff_page")
    monkeypatch.setattr(page, "presets", lambda: iter([["a muscle"]]))
    words = ["tradeoff_page.py", "--out", str(tmp_path / "new" / "folder"), "--only", "presets"]
    monkeypatch.setattr("sys.argv", words)
    page.main()
    assert "a muscle" in (tmp_path / "new/folder/presets.csv").read_text()
    monkeypatch.setattr("sys.argv", [*words, "preset"])
    with pytest.raises(SystemExit, match="2"):
        page.main()
    assert "there is no table preset; there are presets" in capsys.readouterr().err

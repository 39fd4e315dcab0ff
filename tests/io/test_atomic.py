from __future__ import annotations

import os
import stat

import control as ct
import pandas as pd
import pytest

import ctrl_realize as cr
from ctrl_realize.cli.staging import appearing
from ctrl_realize.io.atomic import replaced_when_complete, write_text
from ctrl_realize.io.text.csv_files import write_csv


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_the_text_is_written_and_nothing_else_is_left(tmp_path):
    write_text(tmp_path / "a.txt", "one\ntwo\n")
    assert (tmp_path / "a.txt").read_bytes() == b"one\ntwo\n"
    assert names(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("reason", [RuntimeError, KeyboardInterrupt])
def test_after_a_failure_the_old_file_is_whole_and_the_folder_clean(tmp_path, reason):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with pytest.raises(reason), replaced_when_complete(file) as temporary:  # noqa: PT012
        temporary.write_text("half of the n")
        raise reason
    assert file.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def test_a_missing_folder_is_an_error_of_the_system(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_text(tmp_path / "nowhere" / "a.txt", "text")


def test_a_folder_in_place_of_the_file_is_not_replaced(tmp_path):
    (tmp_path / "a.txt").mkdir()
    with pytest.raises(OSError, match=r"a\.txt"):
        write_text(tmp_path / "a.txt", "text")
    assert names(tmp_path) == ["a.txt"]


def test_permissions_are_those_of_the_old_file_or_of_any_new_one(tmp_path):
    plain = tmp_path / "plain.txt"
    plain.write_text("made by the system")
    write_text(tmp_path / "new.txt", "text")
    assert stat.S_IMODE((tmp_path / "new.txt").stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)
    plain.chmod(0o640)
    write_text(plain, "text")
    assert stat.S_IMODE(plain.stat().st_mode) == 0o640


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "target.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("target.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "target.txt").read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_what_is_no_regular_file_is_not_replaced(tmp_path):
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    model = cr.delayed_ss(ct.ss(0.9, 1, 0.1, 0, 0.01), 37)
    table = pd.DataFrame({"a": [1]})
    for target in (pipe, link, "/dev/null"):
        for write in (
            lambda path: cr.save_model(path, model),
            lambda path: write_text(path, "text"),
            lambda path: write_csv(path, table, index=False),
        ):
            with pytest.raises(OSError, match="is not replaced"):
                write(target)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert link.is_symlink()
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert names(tmp_path) == ["link", "pipe"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_results_replace_nothing_in_their_folder_that_is_no_regular_file(tmp_path):
    os.mkfifo(tmp_path / "b.txt")
    (tmp_path / "a.txt").write_text("old")
    with pytest.raises(OSError, match="is not replaced"), appearing(tmp_path) as staged:  # noqa: PT012
        for name in ("a.txt", "b.txt"):
            (staged / name).write_text("new")
    assert names(tmp_path) == ["a.txt", "b.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"  # all or nothing

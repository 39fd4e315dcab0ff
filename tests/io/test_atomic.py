from __future__ import annotations

import stat

import pytest

from ctrl_realize.io.atomic import replaced_when_complete, write_text


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

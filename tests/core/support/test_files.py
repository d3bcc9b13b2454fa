"""`core.support.files`: files are written whole, and a change is noticed."""

import os
import time
from pathlib import Path

import pytest

from core.errors import UserError
from core.support.files import file_mark, read_text, read_untrusted, write_whole


def test_a_file_is_replaced_whole(tmp_path):
    file = tmp_path / "reply.json"
    file.write_text("old")
    reader = file.open()
    write_whole(file, b"new and longer")
    with reader:
        assert reader.read() == "old", "who has it open goes on with the old one"
    assert file.read_bytes() == b"new and longer"
    assert [left.name for left in tmp_path.iterdir()] == ["reply.json"]


def test_a_link_is_replaced_and_not_followed(tmp_path):
    target, link = tmp_path / "precious", tmp_path / "reply.json"
    target.write_text("precious")
    link.symlink_to(target)
    write_whole(link, b"reply")
    assert target.read_text() == "precious"
    assert not link.is_symlink()
    assert link.read_text() == "reply"


def test_what_an_ended_process_left_is_removed(tmp_path):
    (tmp_path / "reply.json.part").write_text("half of a rep")
    write_whole(tmp_path / "reply.json", b"reply")
    assert [left.name for left in tmp_path.iterdir()] == ["reply.json"]


def test_processes_that_share_a_file_have_parts_of_their_own(tmp_path):
    other = tmp_path / "reply.json.part"
    other.write_text("half of a rep")
    write_whole(tmp_path / "reply.json", b"reply", shared=True)
    assert other.read_text() == "half of a rep"


def test_what_cannot_be_written_leaves_nothing(tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(OSError, match="taken"):
        write_whole(tmp_path / "taken", b"reply")
    assert [left.name for left in tmp_path.iterdir()] == ["taken"]


def test_a_change_of_the_same_length_and_date_is_noticed(tmp_path):
    file = tmp_path / "reply.json"
    assert file_mark(file) is None
    file.write_text("one")
    before = file_mark(file)
    assert before is not None
    assert file_mark(file) == before
    was = file.stat()
    time.sleep(0.05)  # the file system's clock ticks some hundred times a second
    file.write_text("two")
    os.utime(file, ns=(was.st_mtime_ns, was.st_mtime_ns))
    now = file.stat()
    assert file_mark(file) != before
    assert (now.st_size, now.st_mtime_ns) == (was.st_size, was.st_mtime_ns)


def test_a_link_within_a_folder_is_followed_and_one_that_leads_out_is_not(tmp_path):
    folder, outside = tmp_path / "folder", tmp_path / "outside"
    folder.mkdir()
    for path in (folder / "made", outside):
        path.write_bytes(b"12345")
    (folder / "inside").symlink_to("made")
    (folder / "out").symlink_to(outside)
    (folder / "round").symlink_to("round")
    assert read_untrusted(folder / "inside", 5, within=folder) == b"12345"
    assert read_untrusted(folder / "out", 5) == b"12345"
    with pytest.raises(UserError, match="out is a link that leads out of"):
        read_untrusted(folder / "out", 5, within=folder)
    with pytest.raises(UserError, match="is a link that leads out of"):
        read_text(folder / ".." / "outside", within=folder)
    with pytest.raises(UserError, match="round can't be read"):
        read_untrusted(folder / "round", 5, within=folder)


def test_what_others_made_is_read_if_it_is_a_regular_file_of_bounded_size(
    tmp_path,
):
    file, link, pipe = tmp_path / "made", tmp_path / "link", tmp_path / "pipe"
    file.write_bytes(b"12345")
    link.symlink_to(file)
    assert read_untrusted(file, 5) == read_untrusted(link, 5) == b"12345"
    os.mkfifo(pipe)
    for wrong, reason in {
        pipe: "pipe is no regular file",
        tmp_path: "can.t be read: Is a directory",
        Path("/dev/zero"): "/dev/zero is no regular file",
        tmp_path / "none": "none can't be read: No such file",
        tmp_path / "a\0b": "can't be a file's name: .*embedded null",
        Path(
            "/proc/version"
        ): r"/proc/version has .* at most 4e-06 MB are read",  # its size is 0, and it has bytes
        file: "made has 0.0 MB; at most 4e-06 MB are read",
    }.items():
        with pytest.raises(UserError, match=reason) as caught:
            read_untrusted(wrong, 4)
        assert "\n" not in str(caught.value)

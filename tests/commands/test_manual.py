"""The picture in the manual is what `check` prints."""

from builders import terminal


def test_the_picture_of_check_is_what_it_prints(tmp_path):
    lines = terminal.shown(tmp_path)
    assert sum(line.lstrip().startswith("->") for line in lines) == 9 and max(map(len, lines)) <= terminal.COLUMNS
    assert terminal.PICTURE.read_text() == terminal.svg(lines), terminal.__doc__

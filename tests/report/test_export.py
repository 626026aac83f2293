import pandas as pd

from sidegan.report.export import markdown, show, write_table


def table():
    return pd.DataFrame(
        {"duration [s]": ["16", "560"], "a|b": ["1|2", "3"]}, index=["seeds", "long"]
    ).rename_axis("set")


def cells(line):
    """Cells of a Markdown row."""
    return [cell.strip().replace("\\|", "|") for cell in line.strip("| ").replace("\\|", "\0").split("|")]


def test_markdown_has_a_header_a_rule_and_escaped_bars():
    lines = markdown(table().reset_index()).split("\n")
    assert lines[0] == r"| set | duration [s] | a\|b |"
    assert lines[1] == "| --- | ---: | --- |"  # numbers line up on the right
    assert lines[2] == r"| seeds | 16 | 1\|2 |"
    assert len(lines) == 4
    assert all(len(cells(line)) == 3 for line in lines)


def test_words_stand_on_the_left_and_what_is_unknown_is_a_dash():
    frame = pd.DataFrame({"n": ["1.5e-3 ± 0.1", None], "word": ["a\xa01", "2\n3"]})
    assert markdown(frame).split("\n")[1:] == ["| ---: | --- |", "| 1.5e-3 ± 0.1 | a\xa01 |", "| — | 2 3 |"]


def test_a_table_is_written_as_csv_and_markdown(tmp_path):
    write_table(table(), tmp_path / "new" / "table1", "Table I")
    read = pd.read_csv(tmp_path / "new" / "table1.csv", dtype=str)
    pd.testing.assert_frame_equal(read, table().reset_index().astype(str), check_dtype=False)
    text = (tmp_path / "new" / "table1.md").read_text(encoding="utf-8")
    assert text == f"Table I\n\n{markdown(table().reset_index())}\n"


def test_a_shown_table_is_whole_on_standard_output(capsys):
    show(table(), "Table [I]")
    out, err = capsys.readouterr()
    for text in ("Table [I]", "duration [s]", "a|b", "seeds", "long", "560", "1|2"):
        assert text in out
    assert not err
    assert "\x1b" not in out

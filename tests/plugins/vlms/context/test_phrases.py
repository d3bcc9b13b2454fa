from plugins.vlms.context.phrases import table


def test_no_text_of_a_cell_ends_its_cell_or_row():
    assert (
        table(["a", "b"], [["x|y", "1\n| 2"]])
        == "| a | b |\n| --- | --- |\n| x\\|y | 1 \\| 2 |"
    )

"""Tables of numbers from text files: what other programs write is read, what is no table is named."""

import numpy as np
import pytest

from exumob.support.tables import read_table

PLAIN = "x [m],y [m]\n1.5,2\n-3e-1,4\n"


@pytest.mark.parametrize("text", [
    PLAIN.encode(), PLAIN.encode("utf-8-sig"), PLAIN.encode("utf-16"), PLAIN.replace("\n", "\r\n").encode(),
    PLAIN.replace("\n", "\r").encode(), PLAIN.replace(",", ";").encode(), PLAIN.replace(",", "\t").encode(),
    PLAIN.replace(",", ";").replace(".", ",").encode(), PLAIN.replace(",", " , ").encode(), PLAIN.strip().encode(),
    b"# from a tank\n\n" + PLAIN.replace("\n", "\n\n").encode(), b'"x [m]","y [m]"\n"1.5","2"\n"-0.3","4"\n',
], ids=["plain", "BOM", "UTF-16", "CRLF", "CR", "semicolons", "tabs", "decimal commas", "spaces", "no last line end",
        "comments and empty lines", "quoted"])  # fmt: skip
def test_what_programs_write_is_read(text, tmp_path):
    file = tmp_path / "table.csv"
    file.write_bytes(text)
    found = read_table(file)
    assert list(found) == ["x [m]", "y [m]"]
    assert list(found["x [m]"]) == [1.5, -0.3] and list(found["y [m]"]) == [2.0, 4.0]


def test_empty_fields_are_gaps(tmp_path):
    file = tmp_path / "table.csv"
    file.write_text("x,y\n1,\n2,nan\n")
    assert np.isnan(read_table(file)["y"]).all()


@pytest.mark.parametrize("text, word", [
    (b"", "is empty"), (b" \n\n", "is empty"), (b"# nothing\n", "comments only"), (b"x,y\n", "but no rows"),
    ("Höhe,y\n1,2\n".encode("latin-1"), "line 1 is not UTF-8"), (b"x,y\n1,2\n\xe9,3\n", "line 3 is not UTF-8"),
    (b"x,y\n1,2\n3\n", "line 3 has 1 fields, and there are 2 columns.*commas"),
    (b"x,y\n1,2,3\n", "line 2 has 3 fields"),
    (b"# a\n\nx;y\n1;2\n\n3\n", "line 6 has 1 fields.*semicolons"), (b"1,2\n3,4\n", "begins with numbers"),
    (b"x,x\n1,2\n", "two columns are named 'x'"), (b"x,\n1,2\n", "column 2 has no name"),
    (b"x,y\n1,two\n", "line 2, column 'y': 'two' is not a number"), (b"x,y\n1,1_000\n", "'1_000' is not a number"),
    (b'x,y\n1,"2\n3,4\n', "is not a table"), (b"\x89PNG\r\n\x1a\n\x00", "is not UTF-8"),
    (b"a\x00b\n1\n", "not a text file"),
    (b"x y\n1 2\n", "'1 2' is not a number"),
])  # fmt: skip
def test_what_is_no_table_is_named(text, word, tmp_path):
    file = tmp_path / "table.csv"
    file.write_bytes(text)
    with pytest.raises(ValueError, match=word) as error:
        read_table(file)
    assert "table.csv" in str(error.value)


def test_files_that_are_none_are_named(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="does not exist"):
        read_table(tmp_path / "no.csv")
    with pytest.raises(ValueError, match="cannot be read"):
        read_table(tmp_path)
    monkeypatch.setattr("exumob.support.tables.LARGEST", 5)
    (tmp_path / "big.csv").write_text(PLAIN)
    with pytest.raises(ValueError, match="larger than"):
        read_table(tmp_path / "big.csv")

//! Texts as they come.

use super::*;
use crate::import::grid::Cell;
use instruments::Unit;

fn grid(text: &str) -> Grid {
    read(text.as_bytes(), Marks::default()).unwrap_or_else(|e| panic!("{text}: {e:?}"))
}

fn numbers(grid: &Grid) -> Vec<Vec<f64>> {
    let number = |c: &Cell| c.digits(grid.comma).and_then(|d| Unit::SI.apply(&d)).unwrap_or(f64::NAN);
    grid.rows.iter().map(|r| r.cells.iter().map(number).collect()).collect()
}

#[test]
fn delimiter_and_decimal_mark_are_found() {
    for text in [
        "a,b\n1.5,2\n-3,4e-1\n",
        "a;b\n1,5;2\n-3;4e-1\n",
        "a\tb\r\n1,5\t2\r\n-3\t0,4\r\n",
        "a b\n1.5   2\n  -3 0.4\n",
        "Operator: A. Nonym\nDate;1.5.2024\n\"a\";\"b\"\n1,5;2\n-3;0,4\n",
        "# measured, with care\n# a b\n1.5 2\n-3 0.4\n",
        "a|b\n[um]|[N]\n1.5|2\n-3|0.4\n",
        "a b\n1.5D+00 2.0D+00\n-3.0D+00 4.0d-01\n",
    ] {
        let found = grid(text);
        assert_eq!(found.header, ["a", "b"], "{text}");
        assert_eq!(numbers(&found), [[1.5, 2.0], [-3.0, 0.4]], "{text}");
    }
    assert_eq!(grid("a|b\n[um]|[N]\n1.5|2\n-3|0.4\n").units, ["[um]", "[N]"]);
    assert_eq!(grid("1 2\n3 4\n").header, ["#1", "#2"]);
}

#[test]
fn encodings_are_told_apart() {
    let latin = b"w [\xb5m];F\n1,5;2\n2;3\n";
    assert_eq!(read(latin, Marks::default()).unwrap().header[0], "w [µm]");
    let bare: Vec<u8> = "w\tF\n1.5\t2\n2\t3\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert_eq!(read(&bare, Marks::default()).unwrap().header, ["w", "F"]);
    let mut wide = vec![0xff, 0xfe];
    wide.extend("w [µm]\tF\n1.5\t2\n2\t3\n".encode_utf16().flat_map(u16::to_le_bytes));
    let wide = read(&wide, Marks::default()).unwrap();
    assert_eq!((wide.header[0].as_str(), wide.rows.len()), ("w [µm]", 2));
    assert!(read(b"\x00\x01\x02", Marks::default()).is_err());
}

#[test]
fn both_decimal_marks_are_refused_until_one_is_named() {
    let text = b"a;b\n1,5;2.5\n3;4\n";
    assert!(read(text, Marks::default()).unwrap_err().to_string().contains("line 2"));
    let stated = read(text, Marks { decimal: Some(','), ..Marks::default() }).unwrap();
    assert!(stated.comma);
}

#[test]
fn a_mark_that_may_part_thousands_is_refused() {
    for (text, mark) in [
        ("t;F\n1;500\n2;750\n3;1.000\n4;1.250\n", '.'),
        ("t;F\n1;500\n2;750\n3;1,000\n4;1,250\n", ','),
        ("t,F\n1,500\n2,750\n3,1.000\n4,1.250\n", '.'),
        ("t,F\n1,500\n2,750\n3,\"1,000\"\n4,\"1,250\"\n", ','),
    ] {
        let refused = read(text.as_bytes(), Marks::default()).unwrap_err();
        assert!(refused.to_string().starts_with("line 4: '1"), "{text}: {refused}");
        let stated = Marks { decimal: Some(mark), ..Marks::default() };
        assert!(mark == ',' && text.contains('"') || read(text.as_bytes(), stated).is_ok(), "{text}");
    }
    for text in
        ["t;F\n1;500\n2;0.750\n", "t;F\n1;2\n2;1.125\n", "t;F\n1;500\n2;1.25\n", "t;F\n1;1500\n2;1.250\n"]
    {
        assert!(read(text.as_bytes(), Marks::default()).is_ok(), "{text}");
    }
}

#[test]
fn quoted_decimal_commas_are_read_beside_commas() {
    for text in ["a,b\n\"1,5\",2\n-3,\"0,4\"\n", "\"a\",\"b\"\n\"1,5\",\"2,0\"\n\"-3,0\",\"0,4\"\n"] {
        assert_eq!(numbers(&grid(text)), [[1.5, 2.0], [-3.0, 0.4]], "{text}");
    }
}

#[test]
fn marks_of_thousands_are_read_where_nothing_else_can_be_meant() {
    let read = |text: &str, decimal| read(text.as_bytes(), Marks { decimal, ..Marks::default() });
    for (number, decimal) in [
        ("1.234,5", Some(',')),
        ("1,234.5", Some('.')),
        ("1'234.5", None),
        ("1’234.5", None),
        ("1\u{a0}234.5", None),
        ("1\u{202f}234,5", None),
    ] {
        let found = read(&format!("a;b\n{number};2\n-{number};3\n"), decimal).unwrap();
        assert_eq!(numbers(&found), [[1234.5, 2.0], [-1234.5, 3.0]], "{number}");
    }
    let grouped = read("a;b\n1.234.567;2\n1,5;3\n", Some(',')).unwrap();
    assert_eq!(numbers(&grouped)[0][0], 1_234_567.0);
    for number in ["12.34,5", "1'23.5", "1.2345,5", "1'1e5"] {
        let found = read(&format!("a;b\n{number};2\n1;3\n"), Some(',')).unwrap();
        assert!(numbers(&found)[0][0].is_nan(), "{number}");
    }
}

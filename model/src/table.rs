//! Tables of numbers in files that others wrote: CSV, as a spreadsheet or a script writes it.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

use csv::StringRecord;

/// The longest file, bytes: some ten million lines.
const LONGEST: u64 = 128 << 20;

/// Why a file is no table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// It cannot be read.
    #[error("{0}")]
    Unreadable(#[from] io::Error),
    /// It is a pipe, a device or a directory, which might never end.
    #[error("it is no regular file")]
    NotRegular,
    /// It is longer than any table.
    #[error("it is longer than 128 MiB")]
    TooLong,
    /// It is no CSV.
    #[error("it is no CSV file: {0}")]
    Malformed(#[from] csv::Error),
}

/// A table with a line of titles.
///
/// Cells may be quoted and have blanks around them; the file may begin with a byte-order mark; lines
/// without content are left out.
#[derive(Clone, Debug)]
pub struct Table {
    titles: StringRecord,
    /// Each with its line in the file, from 1.
    rows: Vec<(u64, StringRecord)>,
}

impl Table {
    /// Reads a regular file.
    pub fn read(file: &Path) -> Result<Self, TableError> {
        // Before it is opened: to open a pipe may take for ever.
        if !std::fs::metadata(file)?.is_file() {
            return Err(TableError::NotRegular);
        }
        let mut text = String::new();
        File::open(file)?.take(LONGEST + 1).read_to_string(&mut text)?;
        if text.len() as u64 > LONGEST {
            return Err(TableError::TooLong);
        }
        Self::parse(&text)
    }

    /// Reads a text.
    pub fn parse(text: &str) -> Result<Self, TableError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let titles = reader.headers()?.clone();
        let mut rows = Vec::new();
        // The reader's own line is that of the end of the record before.
        let (mut counted, mut line) = (0, 1);
        for record in reader.records() {
            let record = record?;
            let ended = record.position().map_or(0, |position| position.byte() as usize);
            let blank = |byte: &&u8| matches!(byte, b'\r' | b'\n');
            let begins = ended + text.as_bytes()[ended..].iter().take_while(blank).count();
            line += text.as_bytes()[counted..begins].iter().filter(|byte| **byte == b'\n').count()
                as u64;
            counted = begins;
            if record.iter().any(|cell| !cell.is_empty()) {
                rows.push((line, record));
            }
        }
        Ok(Self { titles, rows })
    }

    /// The place of a column.
    pub fn column(&self, title: &str) -> Option<usize> {
        self.titles.iter().position(|found| found == title)
    }

    /// All titles, separated by commas.
    pub fn titles(&self) -> String {
        self.titles.iter().collect::<Vec<_>>().join(", ")
    }

    /// The cells of a column, each with its line in the file, from 1; empty where a row is shorter.
    pub fn cells(&self, column: usize) -> impl Iterator<Item = (u64, &str)> {
        self.rows.iter().map(move |(line, row)| (*line, row.get(column).unwrap_or_default()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_as_spreadsheets_and_scripts_write_it() {
        let text = "\u{feff}\"time_s\", x_m\r\n\"1.5\",\"a, b\"\r\n,\r\n\n2 ,\"two\nlines\"\r\n3\n";
        let table = Table::parse(text).unwrap();
        assert_eq!((table.column("time_s"), table.column("x_m")), (Some(0), Some(1)));
        assert_eq!((table.column("y_m"), table.titles().as_str()), (None, "time_s, x_m"));
        let times: Vec<_> = table.cells(0).collect();
        assert_eq!(times, [(2, "1.5"), (5, "2"), (7, "3")]);
        let words: Vec<_> = table.cells(1).map(|(_, cell)| cell).collect();
        assert_eq!(words, ["a, b", "two\nlines", ""]);
    }

    #[test]
    fn what_is_no_regular_file_is_not_opened() {
        let error = Table::read(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error.to_string(), "it is no regular file");
        let missing = Table::read(Path::new("/no/such.csv")).unwrap_err();
        assert!(matches!(missing, TableError::Unreadable(_)));
    }
}

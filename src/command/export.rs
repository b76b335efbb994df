//! `mtj export`: a recording as tables.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use clap::Args;
use mtj_model::law;
use mtj_monitor::recording::{self, RecordedMessage, Recording, TOPICS, Topic};
use mtj_protocol::{
    port::Message,
    sample::{Field, text_of},
};

use crate::failure::Failure;

/// Turn a recording into tables, one CSV file for each topic
#[derive(Args, Debug)]
pub struct Export {
    /// A recording
    #[arg(value_name = "FILE.mcap")]
    recording: PathBuf,
    /// Folder for the tables; units.csv tells their units
    #[arg(long, value_name = "DIR")]
    csv: PathBuf,
    /// Replace tables that are there already
    #[arg(long)]
    overwrite: bool,
}

/// A column or, for a list, as many columns as the longest such list has numbers.
struct Column {
    name: &'static str,
    numbers: Option<usize>,
}

type Layout = Vec<Column>;

struct Table {
    layout: Layout,
    out: BufWriter<File>,
    rows: u64,
}

impl Export {
    /// Reads the recording twice: a table's columns have to be known before its first row.
    pub fn run(self) -> Result<(), Failure> {
        let mut layouts: [Layout; TOPICS.len()] = Default::default();
        // Of the laws that were in effect.
        let mut echo_units = BTreeSet::new();
        for recorded in self.open()? {
            let message = recorded?.message;
            if let Message::Error(error) = &message {
                echo_units.extend(law::find(text_of(&error.law)).map(|law| law.echo.unit));
            }
            widen(&mut layouts[Topic::of(&message) as usize], &message);
        }
        if layouts.iter().all(Vec::is_empty) {
            let file = self.recording.display();
            return Err(Failure::bad_input(format!(
                "{file}: no messages of mtj are recorded in it"
            )));
        }
        let mut tables = self.create(layouts, &echo_units)?;
        let mut recording = self.open()?;
        for recorded in &mut recording {
            let recorded = recorded?;
            if let Some(table) = &mut tables[Topic::of(&recorded.message) as usize] {
                table.add(&recorded)?;
            }
        }
        let mut out = io::stdout().lock();
        for (topic, table) in TOPICS.iter().zip(&mut tables) {
            if let Some(table) = table {
                table.out.flush()?;
                writeln!(out, "{}: {} rows", self.path(*topic).display(), table.rows)?;
            }
        }
        if recording.is_cut_short() {
            tracing::warn!(
                "{} was cut short; these are all messages up to there",
                self.recording.display()
            );
        }
        Ok(())
    }

    fn open(&self) -> Result<Recording, Failure> {
        Ok(Recording::open(&self.recording)?)
    }

    fn path(&self, topic: Topic) -> PathBuf {
        self.csv.join(format!("{}.csv", topic.name()))
    }

    fn create(
        &self,
        layouts: [Layout; TOPICS.len()],
        echo_units: &BTreeSet<&'static str>,
    ) -> Result<[Option<Table>; TOPICS.len()], Failure> {
        let refuse = |path: &Path, error: &io::Error| {
            let remedy = match error.kind() {
                io::ErrorKind::AlreadyExists => {
                    "the file exists; choose another folder, or add --overwrite to replace it"
                }
                _ => "choose a folder that can be written",
            };
            Failure::bad_input(format!("--csv {}: {error}; {remedy}", path.display()))
        };
        let create = |path: &Path| {
            let file = if self.overwrite { File::create(path) } else { File::create_new(path) };
            file.map(BufWriter::new).map_err(|error| refuse(path, &error))
        };
        fs::create_dir_all(&self.csv).map_err(|error| refuse(&self.csv, &error))?;
        let mut units = create(&self.csv.join("units.csv"))?;
        writeln!(units, "table,column,unit")?;
        let mut tables: [Option<Table>; TOPICS.len()] = Default::default();
        for (topic, layout) in TOPICS.into_iter().zip(layouts) {
            if layout.is_empty() {
                continue;
            }
            for column in &layout {
                let is_echo = recording::is_echo(column.name) && echo_units.len() == 1;
                let known = echo_units.first().filter(|_| is_echo);
                let unit = known.copied().unwrap_or_else(|| recording::unit(column.name));
                for name in column.names() {
                    writeln!(units, "{},{name},{unit}", topic.name())?;
                }
            }
            let mut out = create(&self.path(topic))?;
            writeln!(out, "{}", names(&layout).join(","))?;
            tables[topic as usize] = Some(Table { layout, out, rows: 0 });
        }
        units.flush()?;
        Ok(tables)
    }
}

const LOG_TIME: &str = "log_time_ns";

/// Shows a message with its header, field by field.
fn show_all(message: &Message, show: &mut dyn FnMut(&'static str, Field<'_>)) {
    if let Some(header) = recording::header(message) {
        header.fields(show);
    }
    recording::fields(message, show);
}

/// Adds the columns that a message needs: errors show the signals of the law that was in effect.
fn widen(layout: &mut Layout, message: &Message) {
    if layout.is_empty() {
        layout.push(Column { name: LOG_TIME, numbers: None });
    }
    show_all(message, &mut |name, field| {
        let place = place(layout, name).unwrap_or_else(|| {
            let numbers = matches!(field, Field::Numbers(_)).then_some(0);
            layout.push(Column { name, numbers });
            layout.len() - 1
        });
        if let (Some(most), Field::Numbers(list)) = (&mut layout[place].numbers, field) {
            *most = list.len().max(*most);
        }
    });
}

fn place(layout: &Layout, name: &str) -> Option<usize> {
    layout.iter().position(|column| column.name == name)
}

fn names(layout: &Layout) -> Vec<String> {
    layout.iter().flat_map(Column::names).collect()
}

impl Table {
    fn add(&mut self, recorded: &RecordedMessage) -> io::Result<()> {
        let mut cells: Vec<_> = self.layout.iter().map(|column| column.cells(&[])).collect();
        cells[0] = vec![recorded.log_time.to_string()];
        show_all(&recorded.message, &mut |name, field| {
            let Some(place) = place(&self.layout, name) else { return };
            cells[place] = match field {
                Field::Count(count) => vec![count.to_string()],
                Field::Text(words) => vec![format!("\"{}\"", words.replace('"', "\"\""))],
                Field::Numbers(list) => self.layout[place].cells(list),
            };
        });
        self.rows += 1;
        writeln!(self.out, "{}", cells.concat().join(","))
    }
}

impl Column {
    /// Its name, or one for each number of a list.
    fn names(&self) -> Vec<String> {
        match self.numbers {
            None => vec![self.name.to_owned()],
            Some(most) => (0..most).map(|i| format!("{}_{i}", self.name)).collect(),
        }
    }

    /// As many cells as the longest list has numbers, or one; those past the end of a list are
    /// empty. Numbers have the shortest digits that mean the same.
    fn cells(&self, list: &[f64]) -> Vec<String> {
        let mut cells: Vec<_> = list.iter().map(|number| format!("{number:?}")).collect();
        cells.resize(self.numbers.unwrap_or(1), String::new());
        cells
    }
}

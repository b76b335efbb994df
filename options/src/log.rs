//! Logs on standard error: `mtj plant: waiting for a controller`.

use std::{
    env, fmt,
    io::{self, Write},
    sync::OnceLock,
};

use tracing::{
    Event, Level, Subscriber,
    field::{Field, Visit},
};
use tracing_subscriber::{
    Layer, Registry,
    filter::Targets,
    fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter, format::Writer},
    layer::SubscriberExt,
    registry::LookupSpan,
    util::SubscriberInitExt,
};

use crate::lossy::LossyWriter;

/// The variable that asks for more, or less: `MTJ_LOG=debug`, or `MTJ_LOG=info,zenoh=warn`.
const VARIABLE: &str = "MTJ_LOG";

/// Writes each event as a line on standard error, after the program's name.
pub fn lines<S>(program: &'static str) -> impl Layer<S>
where
    S: Subscriber + for<'a> LookupSpan<'a>,
{
    tracing_subscriber::fmt::layer().event_format(Sentence { program }).with_writer(Stderr)
}

/// Writes the events that wait to be written; to be called before the process ends, or writes to
/// standard error itself.
pub fn flush() {
    if let Some(writer) = STDERR.get().and_then(Option::as_ref) {
        writer.finish();
    }
}

/// Standard error, which no loop waits for; `None` if there is no thread to write to it.
static STDERR: OnceLock<Option<LossyWriter>> = OnceLock::new();

/// Makes writers to [`STDERR`].
struct Stderr;

impl MakeWriter<'_> for Stderr {
    type Writer = Box<dyn Write>;

    fn make_writer(&self) -> Self::Writer {
        match STDERR.get_or_init(|| LossyWriter::new(io::stderr()).ok()) {
            Some(writer) => Box::new(writer.clone()),
            None => Box::new(io::stderr()),
        }
    }
}

/// Sends the events of this process to a layer, from now on.
pub fn init(layer: impl Layer<Registry> + Send + Sync) {
    // A program that has a subscriber already keeps it.
    let _ = tracing_subscriber::registry().with(layer.with_filter(filter())).try_init();
}

/// What is worth a line: of `mtj`, all but details; of other libraries nothing unless asked for.
fn filter() -> Targets {
    let asked = env::var(VARIABLE).ok().and_then(|text| text.parse().ok());
    asked.unwrap_or_else(|| Targets::new().with_target("mtj", Level::INFO))
}

/// An event as one line: the program's name, and the message.
struct Sentence {
    program: &'static str,
}

impl<S, N> FormatEvent<S, N> for Sentence
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        _context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let mut message = Message::default();
        event.record(&mut message);
        writeln!(writer, "{}: {}", self.program, message.0)
    }
}

/// The text of an event, with fields behind it.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        use fmt::Write;
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

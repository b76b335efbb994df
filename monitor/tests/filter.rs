//! What a filter leaves out, and what recordings and displays then count.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]
#![allow(unreachable_pub, dead_code, reason = "a module of a test binary")]

mod session;

use std::{
    cell::RefCell,
    io,
    path::PathBuf,
    process,
    rc::Rc,
    thread,
    time::{Duration, Instant},
};

use mtj_monitor::{
    filter::{Filter, FilterOptions, SampleTopic},
    lines::Lines,
    monitor::Sink,
    overview::{Alarm, Overview},
    recording::{Recording, Topic, options::RecordingOptions},
};
use mtj_protocol::{member::Role, port::Message};

use session::{CONTROLLER, error, instant, offered, presence, scenario, state, status, torque};

fn filter(every: Option<u64>, topics: &[SampleTopic]) -> Filter {
    FilterOptions { every, topics: topics.to_vec() }.filter()
}

/// A display that keeps what it is shown.
#[derive(Clone, Default)]
struct Shown(Rc<RefCell<(Vec<Message>, Overview)>>);

impl Sink for Shown {
    fn handle(&mut self, message: &Message) {
        let (messages, overview) = &mut *self.0.borrow_mut();
        messages.push(message.clone());
        overview.handle(message);
    }
}

impl Shown {
    fn behind(filter: &Filter) -> (Self, Box<dyn Sink>) {
        let shown = Self::default();
        let display: Box<dyn Sink> = Box::new(shown.clone());
        let mut displays = filter.before(vec![display]);
        (shown, displays.pop().unwrap())
    }

    fn count(&self, topic: Topic) -> usize {
        self.0.borrow().0.iter().filter(|message| Topic::of(message) == topic).count()
    }

    fn missed(&self) -> u64 {
        self.0.borrow().1.missed
    }

    fn alarm(&self) -> Option<Alarm> {
        self.0.borrow().1.alarm()
    }
}

fn always() -> [Message; 3] {
    [offered(0), presence(CONTROLLER, Role::Controller), status(0)]
}

#[test]
fn every_nth_instant_passes_with_all_its_samples_and_other_topics_always_do() {
    let tenth = filter(Some(10), &[]);
    for message in always() {
        assert!(tenth.passes(&message));
    }
    for sequence in 0..100 {
        for message in instant(sequence) {
            assert_eq!(tenth.passes(&message), sequence % 10 == 0, "{sequence}");
        }
    }
    let two = filter(None, &[SampleTopic::State, SampleTopic::Error]);
    for message in always().iter().chain(&[state(3), error(3)]) {
        assert!(two.passes(message));
    }
    assert!(!two.passes(&torque(3)));
    assert!(filter(None, &[]).passes_all() && !two.passes_all() && !tenth.passes_all());
}

#[test]
fn what_is_left_out_is_not_missed_and_what_never_came_is() {
    let (shown, mut display) = Shown::behind(&filter(Some(10), &[]));
    for sequence in 0..1000 {
        for message in instant(sequence) {
            display.handle(&message);
        }
    }
    assert_eq!(shown.count(Topic::State), 100);
    assert_eq!(shown.count(Topic::Torque), 100);
    assert_eq!(shown.missed(), 0);
    // Of the next thousand, the monitor hears nothing of three tens.
    for sequence in (1000..1500).chain(1530..2000) {
        display.handle(&state(sequence));
    }
    assert_eq!(shown.missed(), 3);
}

#[test]
fn a_controller_whose_samples_are_left_out_is_not_silent_until_it_is() {
    for filter in [filter(None, &[SampleTopic::State]), filter(Some(100_000), &[])] {
        let (shown, mut display) = Shown::behind(&filter);
        for message in always() {
            display.handle(&message);
        }
        let mut sequence = 1;
        let mut go_on = |with_controller: bool| {
            let end = Instant::now() + Duration::from_millis(800);
            while Instant::now() < end {
                display.handle(&state(sequence));
                display.handle(&status(sequence));
                if with_controller {
                    display.handle(&torque(sequence));
                    display.handle(&error(sequence));
                }
                sequence += 1;
                thread::sleep(Duration::from_millis(5));
            }
        };
        go_on(true);
        assert_eq!(shown.alarm(), None, "{filter:?}");
        assert_eq!(shown.count(Topic::Torque), 0);
        assert!((2..=5).contains(&shown.count(Topic::Error)), "{}", shown.count(Topic::Error));
        go_on(false);
        assert!(matches!(shown.alarm(), Some(Alarm::ControllerSilent(_))), "{:?}", shown.alarm());
    }
}

#[test]
fn lines_of_text_tell_of_no_missed_samples_behind_a_filter() {
    #[derive(Clone, Default)]
    struct Text(Rc<RefCell<Vec<u8>>>);
    impl io::Write for Text {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.borrow_mut().write(bytes)
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let text = Text::default();
    let lines: Box<dyn Sink> = Box::new(Lines::new(text.clone()));
    let mut lines = filter(Some(20), &[]).before(vec![lines]).pop().unwrap();
    for message in always() {
        lines.handle(&message);
    }
    let end = Instant::now() + Duration::from_millis(1500);
    let mut sequence = 0;
    while Instant::now() < end {
        for message in instant(sequence).iter().chain(&[status(sequence)]) {
            lines.handle(message);
        }
        assert!(lines.refresh().unwrap());
        sequence += 1;
        thread::sleep(Duration::from_millis(2));
    }
    let printed = String::from_utf8(text.0.borrow().clone()).unwrap();
    assert!(printed.contains("|e| ") && !printed.contains("missed"), "{printed}");
}

/// Records the messages and reads them back.
fn recorded(name: &str, filter: Filter, messages: &[Message]) -> Vec<Message> {
    let name = format!("mtj-filter-{}-{name}.mcap", process::id());
    let file: PathBuf = std::env::temp_dir().join(name);
    let options = RecordingOptions { record: Some(file.clone()), ..Default::default() };
    let mut recorder = options.create(&scenario().bus, filter).unwrap().unwrap().start().unwrap();
    for message in messages {
        recorder.handle(message);
    }
    drop(recorder);
    let read = Recording::open(&file).unwrap().map(|recorded| recorded.map(|it| it.message));
    let read = read.collect::<Result<Vec<_>, _>>().unwrap();
    std::fs::remove_file(&file).unwrap();
    read
}

#[test]
fn a_recording_has_what_passes_with_its_own_numbers_and_nothing_else() {
    let all: Vec<Message> = always().into_iter().chain((0..300).flat_map(instant)).collect();
    let expected = |filter: &Filter| -> Vec<Message> {
        all.iter().filter(|message| filter.passes(message)).cloned().collect()
    };
    let every_seventh = filter(Some(7), &[]);
    let read = recorded("seventh", every_seventh.clone(), &all);
    assert_eq!(read.len(), 3 + 3 * 43);
    assert!(read == expected(&every_seventh));
    let errors = filter(Some(7), &[SampleTopic::Error]);
    let read = recorded("errors", errors.clone(), &all);
    assert_eq!(read.len(), 3 + 43);
    assert!(read == expected(&errors));
}

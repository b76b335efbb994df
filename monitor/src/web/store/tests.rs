use mtj_model::scenario::Scenario;
use mtj_protocol::sample::{Header, StateSample, StatusSample, TorqueSample, VERSION, padded};

use super::*;

const MS: u64 = 1_000_000;

fn header(run: u64, time_ns: u64) -> Header {
    let sequence = time_ns / MS;
    Header { version: VERSION, joints: 2, axes: 2, revision: 0, run, sequence, time_ns }
}

fn scenario(run: u64, revision: u32) -> Message {
    let scenario = Scenario::load("sampled/mtj", &[]).unwrap();
    Message::Scenario(Arc::new(Offered { run, revision, scenario }))
}

fn state(run: u64, time_ns: u64) -> Message {
    Message::State(StateSample { header: header(run, time_ns), ..Default::default() })
}

fn torque(run: u64, time_ns: u64, torque: f64) -> Message {
    let header = header(run, time_ns);
    Message::Torque(TorqueSample { header, torque: padded(&[torque]), ..Default::default() })
}

fn status(run: u64, time_ns: u64, phase: u64) -> Message {
    Message::Status(StatusSample { header: header(run, time_ns), phase, ..Default::default() })
}

fn change(run: u64, request: u64) -> Message {
    let header = header(run, 5 * MS);
    Message::Change(ChangeSample { header, request, accepted: 1, ..Default::default() })
}

/// A store of run 1 that has its scenario and the states of so many milliseconds.
fn store(milliseconds: u64) -> Store {
    let mut store = Store::default();
    store.handle(&scenario(1, 0));
    for k in 0..milliseconds {
        store.handle(&state(1, k * MS));
    }
    store
}

fn numbers(update: &Update) -> Vec<u64> {
    update.bins.iter().map(|bin| bin.number).collect()
}

#[test]
fn publications_and_history_hold_the_same_bins_each_once() {
    let mut store = store(0);
    let (mut by_publications, mut lazy, mut by_cursor) =
        (Vec::new(), Cursor::default(), Vec::new());
    for k in 0..3000 {
        store.handle(&state(1, k * MS));
        // Torques come later than their states, but before their bins count as complete.
        if let Some(k) = k.checked_sub(30) {
            store.handle(&torque(1, k * MS, k as f64));
        }
        if k % 50 == 49 {
            let publication = store.publish();
            let update = store.update_of(&publication);
            assert_eq!((update.cursor, update.is_complete), (publication.after, true));
            by_publications.extend(update.bins);
        }
        if k % 700 == 699 {
            loop {
                let update = store.update_since(&lazy, 20);
                assert!(update.bins.len() <= 20);
                lazy = update.cursor;
                by_cursor.extend(update.bins);
                if update.is_complete {
                    break;
                }
            }
        }
    }
    let publication = store.publish();
    by_publications.extend(store.update_of(&publication).bins);
    by_cursor.extend(store.update_since(&lazy, usize::MAX).bins);
    let series = store.reader.index().position("torque.0");
    for bins in [&by_publications, &by_cursor] {
        let numbers: Vec<u64> = bins.iter().map(|bin| bin.number).collect();
        assert_eq!(numbers, (0..294).collect::<Vec<_>>());
        for bin in bins {
            let torque = bin.ranges[series];
            let first = 10.0 * bin.number as f32;
            assert_eq!((torque.min, torque.max), (first, first + 9.0), "bin {}", bin.number);
        }
    }
    assert_eq!(store.late(), 0);
    store.handle(&torque(1, 7 * MS, 0.0));
    assert_eq!(store.late(), 1, "a late sample is counted");
}

#[test]
fn a_fast_run_is_merged_into_whole_groups_that_do_not_overlap() {
    let mut store = store(0);
    let (mut next, mut total) = (0, 0);
    for round in 0..20 {
        for k in 0..1777 {
            store.handle(&state(1, (round * 1777 + k) * 10 * MS));
        }
        let publication = store.publish();
        let update = store.update_of(&publication);
        assert!(
            update.bins.len() <= 500 && update.span >= 3,
            "{} {}",
            update.bins.len(),
            update.span
        );
        for index in numbers(&update) {
            assert_eq!(index, next);
            next = index + update.span;
        }
        total += update.bins.len();
    }
    assert!(total > 20 * 400);
    assert!(next > 20 * 1777 - 20, "{next}");
}

#[test]
fn the_last_bins_of_a_loop_are_shown_though_no_state_follows() {
    let mut store = store(1000);
    store.handle(&status(1, 999 * MS, 3));
    let last = |store: &mut Store| {
        for _ in 0..20 {
            store.publish();
        }
        *numbers(&store.update_since(&Cursor::default(), usize::MAX)).last().unwrap()
    };
    assert_eq!(last(&mut store), 98, "a paused loop may continue in the bin it paused in");
    store.handle(&status(1, 999 * MS, 2));
    assert_eq!(last(&mut store), 99);
    assert_eq!(store.late(), 0);
}

#[test]
fn a_new_run_starts_empty_and_late_samples_of_the_last_one_are_ignored() {
    let mut store = store(1000);
    store.handle(&change(1, 77));
    store.publish();
    let known = store.update_since(&Cursor::default(), usize::MAX).cursor;
    store.handle(&state(2, 0));
    store.handle(&status(1, 999 * MS, 1));
    let publication = store.publish();
    let update = store.update_of(&publication);
    assert!(update.scenario.is_none() && update.bins.is_empty(), "its scenario has not come yet");
    store.handle(&scenario(2, 0));
    for k in 0..200 {
        store.handle(&state(2, k * MS));
        store.handle(&torque(1, (999 - k) * MS, 1e9));
    }
    store.publish();
    for since in [known, Cursor::default()] {
        let update = store.update_since(&since, usize::MAX);
        assert_eq!(update.scenario.unwrap().run, 2);
        assert_eq!(
            update.bins.iter().map(|bin| bin.number).collect::<Vec<_>>(),
            (0..14).collect::<Vec<_>>()
        );
        let series = store.reader.index().position("torque.0");
        assert!(update.bins.iter().all(|bin| bin.ranges[series].is_empty()));
        assert!(update.changes.is_empty());
    }
}

#[test]
fn a_change_is_sent_once_and_with_the_scenario_it_made() {
    let mut store = store(100);
    store.publish();
    let known = store.update_since(&Cursor::default(), usize::MAX).cursor;
    store.handle(&change(1, 77));
    store.handle(&change(1, 77));
    store.handle(&scenario(1, 1));
    let publication = store.publish();
    for update in [store.update_of(&publication), store.update_since(&known, usize::MAX)] {
        assert_eq!(update.changes.len(), 1, "a plant that gets a request twice answers it twice");
        assert_eq!(update.scenario.unwrap().revision, 1);
    }
    let publication = store.publish();
    let update = store.update_of(&publication);
    assert!(update.changes.is_empty() && update.scenario.is_none());
}

#[test]
fn a_page_that_reconnects_gets_what_is_new() {
    let mut store = store(1000);
    store.publish();
    let back = Cursor::of_query("run=1&since=0.57").unwrap();
    let update = store.update_since(&back, usize::MAX);
    assert_eq!((numbers(&update)[0], update.scenario.unwrap().run), (58, 1));
    let elsewhere = Cursor::of_query("since=0.57&run=18446744073709551615").unwrap();
    assert_eq!(numbers(&store.update_since(&elsewhere, usize::MAX))[0], 0);
    for nonsense in ["", "run=1", "run=x&since=1", "run=1&since=-1", "run=1&since=NaN"] {
        assert_eq!(Cursor::of_query(nonsense), None, "{nonsense}");
    }
}

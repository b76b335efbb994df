//! The dashboard in a real browser, over real sessions.

use std::path::{Path, PathBuf};

use crate::browser::{Browser, Scheme};
use crate::{
    needs::needs,
    session::{Running, Session, eventually},
};
use nix::sys::signal::Signal;

const PLANT: &str = "plant --scenario sampled/mtj --set duration=10min";

/// Where pictures of the dashboard are kept.
fn picture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("dashboard").join(name).with_extension("png")
}

/// The address of its dashboard that a monitor prints, with the token.
fn address_of(monitor: &Running) -> String {
    eventually("an address", || {
        let printed = monitor.stderr();
        let (_, rest) = printed.split_once("dashboard at ")?;
        rest.split_once('\n').map(|(url, _)| url.to_owned())
    })
}

/// Shows what a monitor serves, and waits until data flows.
fn watch(monitor: &Running) -> Browser {
    let browser = Browser::open();
    browser.go(&address_of(monitor));
    browser.until("window.mtj?.live.connected && mtj.store.length > 50");
    browser
}

/// A fingerprint of what is drawn on a canvas, and how many of its pixels are not empty.
fn drawn_on(browser: &Browser, selector: &str) -> (String, f64) {
    let found = browser.run(&format!(
        "const canvas = document.querySelector('{selector}');
         const {{ data }} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
         let [hash, inked] = [0, 0];
         for (let i = 0; i < data.length; i += 4) {{
           hash = (Math.imul(hash, 31) + data[i] + 3 * data[i + 1] + 7 * data[i + 2] + data[i + 3]) | 0;
           if (data[i + 3] > 0) inked += 1;
         }}
         return [String(hash), inked];"
    ));
    (found[0].as_str().unwrap().to_owned(), found[1].as_f64().unwrap())
}

/// The root mean square of the plotted tracking error over the last seconds, m.
fn plotted_error(browser: &Browser, seconds: f64) -> f64 {
    browser.run("mtj.view.follow()");
    browser.number(&format!(
        "(() => {{
           const {{ times, length, series }} = mtj.store;
           const {{ high }} = series.get('error.norm');
           let [sum, count] = [0, 0];
           for (let i = length - 1; i >= 0 && times[i] > times[length - 1] - {seconds}; i -= 1) {{
             if (!Number.isNaN(high[i])) [sum, count] = [sum + high[i] ** 2, count + 1];
           }}
           return Math.sqrt(sum / count);
         }})()"
    ))
}

/// Waits until the run's time has gone on by some seconds.
fn let_run(browser: &Browser, seconds: f64) {
    let now = browser.number("mtj.store.newest");
    browser.until(&format!("mtj.store.newest > {}", now + seconds));
}

#[test]
fn the_page_shows_a_session_live() {
    needs!(Browser);
    let session = Session::on("iceoryx2");
    let monitor = session.start("monitor --web 127.0.0.1:0");
    let _plant = session.start(PLANT);
    let _controller = session.start("controller");
    let browser = watch(&monitor);
    browser.look(1440, 900, Scheme::Light);

    // Every series has samples, and what it holds is what the scenario says.
    for series in ["error.0", "error.norm", "law_error.norm", "factor.1", "torque.1", "force.0"] {
        browser.until(&format!("mtj.store.extent('{series}', 0, 1e9)"));
    }
    for series in ["memory.0", "round_trip", "residence", "latency", "period_deviation", "tip.0"] {
        browser.until(&format!("mtj.store.extent('{series}', 0, 1e9)"));
    }
    // The tip is where two links of 1 m end that are as far apart as they are drawn.
    let [upper, lower, tip] = browser
        .run(
            "const { time, arm: [base, elbow, tip] } = mtj.store.poses.at(-2);
         const between = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
         const plotted = ['tip.0', 'tip.1'].map((name) => mtj.store.nearest(name, time, 1));
         return [
           between(base, elbow),
           between(elbow, tip),
           between(tip.slice(0, 2), plotted.map(({ min, max }) => (min + max) / 2)),
         ];",
        )
        .as_array()
        .map(|lengths| [0, 1, 2].map(|i| lengths[i].as_f64().unwrap()))
        .unwrap();
    assert!((upper - 1.0).abs() < 1e-9 && (lower - 1.0).abs() < 1e-9, "{upper} m, {lower} m");
    assert!(tip < 0.05, "the tip is plotted {tip} m from where the arm has it");

    // The plots move.
    let canvases =
        ["#arm", "#lens", "#ruler", "#chart-norm canvas", "#chart-torque canvas", "#histogram"];
    let before = canvases.map(|canvas| drawn_on(&browser, canvas));
    let length = browser.number("mtj.store.length");
    let_run(&browser, 2.0);
    assert!(browser.number("mtj.store.length") > length + 100.0);
    for (canvas, (was, _)) in canvases.iter().zip(before) {
        let (is, inked) = drawn_on(&browser, canvas);
        assert!(inked > 100.0, "{canvas} is all but empty");
        assert_ne!(is, was, "{canvas} stands still");
    }
    // Unless they are held; then data still goes on.
    browser.click("#hold");
    let_run(&browser, 0.5);
    let held = drawn_on(&browser, "#chart-norm canvas");
    let_run(&browser, 1.0);
    assert_eq!(drawn_on(&browser, "#chart-norm canvas"), held);
    browser.click("#follow");

    let roles = browser
        .run("return [...document.querySelectorAll('#roles li')].map((li) => li.dataset.state)");
    assert_eq!(roles, serde_json::json!(["connected", "connected", "connected"]));
    assert_eq!(browser.run("return document.getElementById('banner').hidden"), true);
    assert_eq!(browser.run("return location.hash"), "", "the token stays in the address bar");

    let_run(&browser, 10.0);
    browser.picture(&picture("light"));
    browser.look(1440, 900, Scheme::Dark);
    let_run(&browser, 1.0);
    browser.picture(&picture("dark"));
    for (name, width, height) in [("phone", 390, 844), ("tablet", 820, 1180), ("wide", 1920, 1080)]
    {
        browser.look(width, height, Scheme::Light);
        let_run(&browser, 1.0);
        browser.picture(&picture(name));
        let over = browser
            .number("document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert_eq!(over, 0.0, "the page is wider than {width} pixels");
    }
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn a_knob_turned_in_the_page_shows_in_its_error_plot() {
    needs!(Browser);
    let session = Session::on("iceoryx2");
    let monitor = session.start("monitor --web 127.0.0.1:0");
    // Aiming ahead, mtj stands what a busy machine does to its samples.
    let aiming = "--set law.memory.policy=delivered --set law.prediction.horizon=measured";
    let _plant = session.start(&format!("{PLANT} {aiming}"));
    let _controller = session.start("controller");
    let browser = watch(&monitor);
    browser.look(1440, 900, Scheme::Light);
    browser.run("mtj.view.show(60)");

    // The slider is dragged, stop by stop; it sends some of them and the last.
    let stop = browser.run(
        "const slider = document.getElementById('torque-latency-slider');
         for (let i = 0; i <= 36; i += 1) {
           slider.value = i;
           slider.dispatchEvent(new Event('input', { bubbles: true }));
         }
         return slider.getAttribute('aria-valuetext');",
    );
    assert_eq!(stop, "5 ms");
    browser.until("mtj.store.scenario.knobs['link.torque.latency'] === '5ms'");
    browser.until("mtj.store.marks.at(-1)?.words === 'link.torque.latency=5ms'");
    assert!(browser.number("mtj.store.marks.length") < 10.0, "a slider must not flood the plant");
    // The plotted latency is what was asked for, and at most what the machine added.
    let_run(&browser, 2.0);
    let latency = "mtj.store.extent('latency', mtj.store.newest - 1, 1e9).min";
    assert!((4.9..15.0).contains(&browser.number(latency)), "{} ms", browser.number(latency));
    browser.until("mtj.store.newest > 12");
    let aiming = plotted_error(&browser, 4.0);

    // With as much latency the memory of what was sent is lost.
    browser.click("[data-key='law.prediction.horizon'] label:nth-child(1)");
    browser.until("mtj.store.marks.at(-1)?.words === 'law.prediction.horizon=none'");
    browser.click("[data-key='law.memory.policy'] label:nth-child(1)");
    browser.until("mtj.store.marks.at(-1)?.words === 'law.memory.policy=sent'");
    let_run(&browser, 10.0);
    let sent = plotted_error(&browser, 4.0);
    assert!(sent > 4.0 * aiming, "sent and 5 ms: {aiming} m before, {sent} m after");

    // The steps of the story are buttons; the last one brings the accuracy back.
    browser.click("button[data-set*='horizon=measured']");
    browser.until("mtj.store.scenario.knobs['law.memory.policy'] === 'delivered'");
    browser.until(
        "document.querySelector('button[data-set*=\"horizon=measured\"]').ariaPressed === 'true'",
    );
    let_run(&browser, 14.0);
    let back = plotted_error(&browser, 4.0);
    assert!(back < sent / 3.0, "delivered, aiming ahead: {sent} m before, {back} m after");
    browser.picture(&picture("story"));

    // Without any memory the same gains do worse by far: a law is changed.
    browser.click("[data-key='law.kind'] label:nth-child(1)");
    browser.until("mtj.store.marks.at(-1)?.words === 'law.kind=tj'");
    browser.until("document.getElementById('law').textContent === 'tj'");
    // Knobs and plots are those of the law.
    for (selector, is_there) in [
        ("[data-key='law.kp']", true),
        ("[data-key='law.prediction.horizon']", true),
        ("[data-key='law.memory.policy']", false),
        ("[data-key='law.factor.kind']", false),
        ("#chart-force:not([hidden])", true),
        ("#chart-factor:not([hidden])", false),
        ("#chart-memory:not([hidden])", false),
    ] {
        browser.until(&format!("Boolean(document.querySelector(\"{selector}\")) === {is_there}"));
    }
    let_run(&browser, 6.0);
    let tj = plotted_error(&browser, 2.0);
    assert!(tj > 2.0 * back, "tj with mtj's gains: {back} m before, {tj} m after");
    eprintln!("aiming {aiming:.2e} m, sent {sent:.2e} m, aiming {back:.2e} m, tj {tj:.2e} m");
    let refused = browser.run("return mtj.store.marks.filter((mark) => !mark.accepted)");
    assert_eq!(refused, serde_json::json!([]));
    assert_eq!(browser.complaints(), Vec::<String>::new());

    // What is refused is said where it was wished for, and the value in effect is shown again.
    browser.run(
        "const kp = document.getElementById('law-kp');
         kp.value = '-3';
         for (const event of ['input', 'change']) kp.dispatchEvent(new Event(event, { bubbles: true }));",
    );
    browser.until("document.getElementById('refusal-law-kp').textContent.includes('law.kp')");
    assert_eq!(browser.run("return document.getElementById('law-kp').value"), "30");
    browser.until("mtj.store.marks.at(-1)?.accepted === false");
    let_run(&browser, 0.5);
    browser.picture(&picture("refused"));
}

#[test]
fn the_last_seconds_are_saved_by_a_button_that_only_such_a_monitor_shows() {
    needs!(Browser);
    let session = Session::on("iceoryx2");
    let file = session.directory.join("run.mcap");
    let record = format!("--record {} --record-last 10s", file.display());
    let monitor = session.start(&format!("monitor --web 127.0.0.1:0 {record}"));
    let without = session.start("monitor --web 127.0.0.1:0");
    let _plant = session.start(PLANT);
    let _controller = session.start("controller");
    let browser = watch(&monitor);
    browser.look(1440, 900, Scheme::Light);
    browser.until("document.getElementById('save').offsetHeight > 0");
    browser.click("#save");
    browser.until("document.getElementById('saved').textContent.endsWith('run-0001.mcap')");
    assert!(session.directory.join("run-0001.mcap").exists());
    assert_eq!(browser.complaints(), Vec::<String>::new());
    let other = watch(&without);
    assert_eq!(other.run("return document.getElementById('save').offsetHeight"), 0);
}

#[test]
fn a_silent_role_is_announced_until_it_is_back() {
    needs!(Browser);
    let session = Session::on("iceoryx2");
    let monitor = session.start("monitor --web 127.0.0.1:0");
    let _plant = session.start(PLANT);
    let controller = session.start("controller");
    let browser = watch(&monitor);
    browser.look(1440, 900, Scheme::Light);
    let calm = "document.getElementById('banner').hidden";
    browser.until(calm);

    controller.signal(Signal::SIGKILL);
    browser.until("document.getElementById('alarm').textContent.includes('controller is silent')");
    browser.until("document.querySelector('[data-role=controller]').dataset.state === 'silent'");
    browser.until("document.querySelector('#banner .detail').textContent.includes('1.')");
    browser.picture(&picture("alarm"));
    let _another = session.start("controller");
    browser.until(calm);
    assert_eq!(browser.complaints(), Vec::<String>::new());

    // The monitor goes, and comes back at the same place.
    let url = address_of(&monitor);
    let place = url.trim_start_matches("http://").split('/').next().unwrap().to_owned();
    let length = browser.number("mtj.store.length");
    monitor.signal(Signal::SIGKILL);
    browser.until(
        "document.getElementById('alarm').textContent.includes('connection to the monitor')",
    );
    browser.picture(&picture("lost"));
    drop(monitor);
    let monitor = session.start(&format!("monitor --web {place}"));
    assert!(address_of(&monitor).contains(&place), "{}", monitor.stderr());
    browser.until("mtj.live.connected");
    browser.until(calm);
    // What was plotted before is still there, and goes on.
    browser.until(&format!("mtj.store.length > {}", length + 100.0));
}

#[test]
fn keys_move_the_plots_before_anything_was_clicked() {
    const END: &str = "\u{e010}";
    const HOME: &str = "\u{e011}";
    let session = Session::on("iceoryx2");
    let monitor = session.start("monitor --web 127.0.0.1:0");
    let _plant = session.start(PLANT);
    let _controller = session.start("controller");
    let browser = watch(&monitor);
    browser.look(1440, 900, Scheme::Light);
    browser.press(" ");
    browser.until("!mtj.view.following");
    browser.press(END);
    browser.until("mtj.view.following");

    // The focus is on a button now: the space key presses it, other keys still move the plots.
    browser.click("[data-range='60']");
    browser.run("mtj.view.show(20)");
    browser.press(" ");
    browser.until("mtj.view.range === 60 && mtj.view.following");
    browser.press(HOME);
    browser.until("!mtj.view.following");
    browser.press(END);
    browser.until("mtj.view.following");

    // A field needs its keys itself.
    browser.click("#torque-latency");
    browser.press(HOME);
    browser.press(" ");
    assert_eq!(browser.run("return mtj.view.following"), true);
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn a_monitor_that_joins_late_does_not_claim_what_it_cannot_know() {
    let session = Session::on("iceoryx2");
    let plant = session.start(PLANT);
    let _controller = session.start("controller");
    let mut set = session.start("set law.kp=30");
    assert!(set.wait().success(), "{}", set.stderr());
    std::thread::sleep(std::time::Duration::from_secs(6));
    let monitor = session.start("monitor --web 127.0.0.1:0");
    let browser = watch(&monitor);
    let changes = "document.querySelector('#changes').innerText";
    browser.until(&format!("{changes}.includes('monitor joined after 1 change')"));
    // The plant is as old as it is, not as the monitor is.
    browser.until(
        "/for ([0-9.]+)/.exec(document.querySelector('#roles [data-role=plant]').innerText)?.[1] > 5",
    );
    drop(plant);
}

#[test]
fn without_the_token_no_knob_can_be_turned() {
    needs!(Browser);
    let session = Session::on("iceoryx2");
    let monitor = session.start("monitor --web 127.0.0.1:0");
    let _plant = session.start(PLANT);
    let _controller = session.start("controller");
    let url = address_of(&monitor);
    let browser = Browser::open();
    browser.go(url.split_once('#').unwrap().0);
    browser.until("window.mtj?.live.connected && mtj.store.length > 50");
    assert_eq!(browser.run("return document.querySelector('#knobs fieldset.all').disabled"), true);
    assert_eq!(browser.run("return document.getElementById('law-kp').matches(':disabled')"), true);
    let how = browser.run("return document.getElementById('knobs-locked').innerText");
    assert!(how.as_str().unwrap().contains("#token="), "{how}");
    assert_eq!(browser.complaints(), Vec::<String>::new());
    browser.picture(&picture("locked"));

    // A token that is none is forgotten, and the page says so.
    browser.run("sessionStorage.setItem('mtj.token', 'guessed'); location.reload();");
    browser.until(
        "window.mtj?.live.connected && !document.querySelector('#knobs fieldset.all').disabled",
    );
    browser.click("[data-key='law.kind'] label:nth-child(1)");
    browser.until("document.querySelector('#knobs fieldset.all').disabled");
    browser.until("mtj.store.scenario?.knobs['law.kind'] === 'mtj'");
    assert_eq!(browser.number("mtj.store.marks.length"), 0.0);
}

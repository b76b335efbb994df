//! The dashboard in a real browser, over real sessions.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod browser;
mod session;

use std::path::{Path, PathBuf};

use browser::{Browser, Scheme};
use nix::sys::signal::Signal;
use session::{Running, Session, eventually};

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
    let links = browser.run("return mtj.store.scenario.links");
    assert_eq!(links, serde_json::json!([1.0, 1.0]));
    // The tip is where two links of 1 m and the angles that are shown put it.
    let distance = browser.number(
        "(() => {
           const { time, q } = mtj.store.poses.at(-2);
           const [x, y] = [Math.cos(q[0]) + Math.cos(q[0] + q[1]), Math.sin(q[0]) + Math.sin(q[0] + q[1])];
           const tip = ['tip.0', 'tip.1'].map((name) => mtj.store.nearest(name, time, 1));
           return Math.hypot(x - (tip[0].min + tip[0].max) / 2, y - (tip[1].min + tip[1].max) / 2);
         })()",
    );
    assert!(distance < 0.05, "the tip is plotted {distance} m from where the arm has it");

    // The plots move.
    let canvases = ["#arm", "#lens", "#ruler", "#chart-norm canvas", "#chart-torque canvas", "#histogram"];
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

    let roles = browser.run("return [...document.querySelectorAll('#roles li')].map((li) => li.dataset.state)");
    assert_eq!(roles, serde_json::json!(["connected", "connected", "connected"]));
    assert_eq!(browser.run("return document.getElementById('banner').hidden"), true);
    assert_eq!(browser.run("return location.hash"), "", "the token stays in the address bar");

    let_run(&browser, 10.0);
    browser.picture(&picture("light"));
    browser.look(1440, 900, Scheme::Dark);
    let_run(&browser, 1.0);
    browser.picture(&picture("dark"));
    for (name, width, height) in [("phone", 390, 844), ("tablet", 820, 1180), ("wide", 1920, 1080)] {
        browser.look(width, height, Scheme::Light);
        let_run(&browser, 1.0);
        browser.picture(&picture(name));
        let over = browser.number("document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert_eq!(over, 0.0, "the page is wider than {width} pixels");
    }
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn a_knob_turned_in_the_page_shows_in_its_error_plot() {
    let session = Session::on("iceoryx2");
    let monitor = session.start("monitor --web 127.0.0.1:0");
    let _plant = session.start(PLANT);
    let _controller = session.start("controller");
    let browser = watch(&monitor);
    browser.look(1440, 900, Scheme::Light);
    browser.run("mtj.view.show(60)");

    browser.until("mtj.store.newest > 12");
    let sent = plotted_error(&browser, 4.0);
    assert!(sent > 5e-4 && sent < 5e-3, "mtj tracks with {sent} m");

    // One millisecond of latency takes the accuracy of the sent memory; the slider is dragged there.
    let stop = browser.run(
        "const slider = document.getElementById('torque-latency-slider');
         for (let i = 0; i <= 20; i += 1) {
           slider.value = i;
           slider.dispatchEvent(new Event('input', { bubbles: true }));
         }
         return slider.getAttribute('aria-valuetext');",
    );
    assert_eq!(stop, "1 ms");
    browser.until("mtj.store.scenario.knobs['link.torque.latency'] === '1ms'");
    browser.until("mtj.store.marks.some((mark) => mark.words === 'link.torque.latency=1ms')");
    let_run(&browser, 14.0);
    let late = plotted_error(&browser, 4.0);
    assert!(late > 3.0 * sent, "1 ms of latency: {sent} m before, {late} m after");

    // The delivered memory brings it back.
    browser.click("[data-key='law.memory.policy'] label:nth-child(3)");
    browser.until("mtj.store.marks.at(-1)?.words === 'law.memory.policy=delivered'");
    let_run(&browser, 16.0);
    let delivered = plotted_error(&browser, 4.0);
    assert!(delivered < late / 2.0, "the delivered memory: {late} m before, {delivered} m after");
    browser.picture(&picture("story"));
    eprintln!("sent {sent:.2e} m, with 1 ms {late:.2e} m, delivered {delivered:.2e} m");

    // Without any memory the same gains do worse by far: a law is changed.
    browser.click("[data-key='law.kind'] label:nth-child(1)");
    browser.until("mtj.store.marks.at(-1)?.words === 'law.kind=tj'");
    browser.until("document.getElementById('law').textContent === 'tj'");
    let_run(&browser, 6.0);
    let tj = plotted_error(&browser, 2.0);
    assert!(tj > 3.0 * delivered, "tj with mtj's gains: {delivered} m before, {tj} m after");
    // Each mark is where the error begins to change: at a sampling instant of this run.
    let marks = browser.run("return mtj.store.marks.map((mark) => mark.accepted)");
    assert!(marks.as_array().unwrap().len() >= 3 && marks.as_array().unwrap().iter().all(|m| m == true));
    assert_eq!(browser.complaints(), Vec::<String>::new());

    // What is refused is said where it was wished for, and the value in effect is shown again.
    browser.run(
        "const kp = document.getElementById('kp');
         kp.value = '-3';
         for (const event of ['input', 'change']) kp.dispatchEvent(new Event(event, { bubbles: true }));",
    );
    browser.until("document.getElementById('refusal-law-kp').textContent.includes('law.kp')");
    assert_eq!(browser.run("return document.getElementById('kp').value"), "30");
    browser.until("mtj.store.marks.at(-1)?.accepted === false");
    let_run(&browser, 0.5);
    browser.picture(&picture("refused"));
}

#[test]
fn who_falls_silent_is_announced_until_he_is_back() {
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
    browser.until("document.getElementById('alarm').textContent.includes('connection to the monitor')");
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
fn without_the_token_no_knob_can_be_turned() {
    let session = Session::on("iceoryx2");
    let monitor = session.start("monitor --web 127.0.0.1:0");
    let _plant = session.start(PLANT);
    let _controller = session.start("controller");
    let url = address_of(&monitor);
    let browser = Browser::open();
    browser.go(url.split_once('#').unwrap().0);
    browser.until("window.mtj?.live.connected && mtj.store.length > 50");
    assert_eq!(browser.run("return document.querySelector('#knobs fieldset.all').disabled"), true);
    assert_eq!(browser.run("return document.getElementById('kp').matches(':disabled')"), true);
    let how = browser.run("return document.getElementById('knobs-locked').innerText");
    assert!(how.as_str().unwrap().contains("#token="), "{how}");
    assert_eq!(browser.complaints(), Vec::<String>::new());
    browser.picture(&picture("locked"));

    // A token that is none is forgotten, and the page says so.
    browser.run("sessionStorage.setItem('mtj.token', 'guessed'); location.reload();");
    browser.until("window.mtj?.live.connected && !document.querySelector('#knobs fieldset.all').disabled");
    browser.click("[data-key='law.kind'] label:nth-child(1)");
    browser.until("document.querySelector('#knobs fieldset.all').disabled");
    browser.until("mtj.store.scenario?.knobs['law.kind'] === 'mtj'");
    assert_eq!(browser.number("mtj.store.marks.length"), 0.0);
}

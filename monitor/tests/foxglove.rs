//! A Foxglove client, spoken to over a real socket.

#![cfg(feature = "foxglove")]
#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::{
    collections::BTreeMap,
    net::TcpStream,
    sync::Arc,
    time::{Duration, Instant},
};

use mtj_model::scenario::Scenario;
use mtj_monitor::{foxglove::Foxglove, monitor::Sink};
use mtj_protocol::{
    port::{Message, Offered},
    sample::{Header, StateSample, VERSION, padded},
};
use serde_json::{Value, json};
use tungstenite::{Message as Frame, WebSocket, client::IntoClientRequest};

const TOPICS: [&str; 9] = [
    "/mtj/arm",
    "/mtj/change",
    "/mtj/error",
    "/mtj/presence",
    "/mtj/request",
    "/mtj/scenario",
    "/mtj/state",
    "/mtj/status",
    "/mtj/torque",
];

fn connect(port: u16) -> WebSocket<TcpStream> {
    let socket = TcpStream::connect(("127.0.0.1", port)).unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
    let mut request = format!("ws://127.0.0.1:{port}").into_client_request().unwrap();
    let protocol = "foxglove.sdk.v1".parse().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
    let (client, response) = tungstenite::client(request, socket).unwrap();
    assert_eq!(response.headers()["Sec-WebSocket-Protocol"], "foxglove.sdk.v1");
    client
}

/// The next frame for which there is something to say, for a bounded time; meanwhile the server
/// goes on.
#[track_caller]
fn until<T>(
    client: &mut WebSocket<TcpStream>,
    server: &mut Foxglove,
    mut find: impl FnMut(&Frame) -> Option<T>,
) -> T {
    let end = Instant::now() + Duration::from_secs(30);
    loop {
        assert!(Instant::now() < end, "nothing of that kind came");
        assert!(server.refresh().unwrap());
        match client.read() {
            Ok(frame) => {
                if let Some(found) = find(&frame) {
                    return found;
                }
            }
            Err(tungstenite::Error::Io(_)) => {}
            Err(error) => panic!("{error}"),
        }
    }
}

/// Subscription and payload of a message: opcode 1, then the id, the time and the payload.
fn message(frame: &Frame) -> Option<(u32, &[u8])> {
    let Frame::Binary(bytes) = frame else { return None };
    let id = u32::from_le_bytes(bytes.get(1..5)?.try_into().ok()?);
    (bytes[0] == 1).then(|| (id, &bytes[13..]))
}

#[test]
fn foxglove_sees_every_topic_and_its_messages() {
    let mut server = Foxglove::serve("127.0.0.1:0", "test").unwrap();
    let scenario = Scenario::load("sampled/mtj", &[]).unwrap();
    server.handle(&Message::Scenario(Arc::new(Offered { run: 7, revision: 0, scenario })));
    let mut client = connect(server.port().unwrap());

    let mut channels = BTreeMap::new();
    until(&mut client, &mut server, |frame| {
        let Frame::Text(text) = frame else { return None };
        let said: Value = serde_json::from_str(text).unwrap();
        if said["op"] == "advertise" {
            for channel in said["channels"].as_array().unwrap() {
                channels.insert(channel["topic"].as_str().unwrap().to_owned(), channel.clone());
            }
        }
        (channels.len() == TOPICS.len()).then_some(())
    });
    assert_eq!(channels.keys().map(String::as_str).collect::<Vec<_>>(), TOPICS);
    let state = &channels["/mtj/state"];
    assert_eq!(
        (&state["encoding"], &state["schemaEncoding"]),
        (&json!("json"), &json!("jsonschema"))
    );
    let schema: Value = serde_json::from_str(state["schema"].as_str().unwrap()).unwrap();
    assert_eq!(schema["properties"]["position"]["items"]["type"], "number");

    let subscriptions: Vec<Value> = TOPICS
        .iter()
        .enumerate()
        .map(|(id, topic)| json!({"id": id, "channelId": channels[*topic]["id"]}))
        .collect();
    let request = json!({"op": "subscribe", "subscriptions": subscriptions});
    client.send(Frame::text(request.to_string())).unwrap();

    // The scenario has been told long ago, and is told again to who comes late.
    until(&mut client, &mut server, |frame| {
        let (id, json) = message(frame)?;
        let told: Value = serde_json::from_slice(json).ok()?;
        (TOPICS[id as usize] == "/mtj/scenario" && told["name"] == "sampled/mtj").then_some(())
    });
    let header = Header { version: VERSION, joints: 2, axes: 2, run: 7, ..Header::default() };
    let position = padded(&[0.25, -1.5]);
    server.handle(&Message::State(StateSample { header, position, ..StateSample::default() }));
    let (mut state, mut arm) = (None, None);
    until(&mut client, &mut server, |frame| {
        let (id, payload) = message(frame)?;
        match TOPICS[id as usize] {
            "/mtj/state" => state = serde_json::from_slice::<Value>(payload).ok(),
            "/mtj/arm" => arm = Some(payload.to_vec()),
            _ => {}
        }
        (state.is_some() && arm.is_some()).then_some(())
    });
    assert_eq!(state.unwrap()["position"], json!([0.25, -1.5]));
    // In protobuf a double stands as it is: the elbow of a link of 1 m at 0.25 rad.
    let elbow = [0.25f64.cos(), 0.25f64.sin()];
    let arm = arm.unwrap();
    for number in elbow {
        assert!(arm.windows(8).any(|bytes| bytes == number.to_le_bytes()), "no {number} in it");
    }
}

#[test]
fn an_address_that_cannot_be_is_refused_in_words() {
    let taken = Foxglove::serve("127.0.0.1:0", "test").unwrap();
    let again = format!("127.0.0.1:{}", taken.port().unwrap());
    for (address, words) in
        [(again.as_str(), "cannot listen"), ("nowhere", "no port"), ("127.0.0.1:x", "'x'")]
    {
        let sentence = Foxglove::serve(address, "test").err().unwrap().to_string();
        assert!(sentence.contains(address) && sentence.contains(words), "{sentence}");
        assert!(sentence.contains("127.0.0.1:8765"), "{sentence}");
    }
}

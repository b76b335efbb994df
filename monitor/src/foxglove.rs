//! Live to Foxglove: every message as JSON over a WebSocket, and the arm for the 3D panel.

use std::{
    fmt,
    sync::Arc,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use clap::Args;
use foxglove::{
    Channel, Context, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
    messages::{
        Color, LinePrimitive, Point3, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive,
        Timestamp, Vector3, line_primitive,
    },
};
use mtj_model::scene::{Point, Scene};
use mtj_protocol::{
    port::{Message, Offered},
    sample::StateSample,
};

use tracing::info;

use crate::{
    error::MonitorError,
    monitor::Sink,
    recording::{TOPICS, Timeline, Topic, schema, write_json},
};

/// The address at which Foxglove looks by default.
const DEFAULT: &str = "127.0.0.1:8765";
/// How often the arm is drawn.
const PERIOD: Duration = Duration::from_millis(50);

/// Why Foxglove cannot connect.
#[derive(Debug, thiserror::Error)]
#[error("--foxglove {address}: {reason}; expected an address to listen on, like {DEFAULT}")]
pub struct FoxgloveError {
    address: String,
    #[source]
    reason: Reason,
}

#[derive(Debug, thiserror::Error)]
enum Reason {
    #[error("there is no port")]
    NoPort,
    #[error("'{0}' is no port")]
    Port(String),
    #[error("cannot listen there ({0})")]
    Listen(foxglove::FoxgloveError),
    #[error(transparent)]
    Channel(#[from] foxglove::FoxgloveError),
}

impl From<FoxgloveError> for MonitorError {
    fn from(error: FoxgloveError) -> Self {
        Self::of(error, true)
    }
}

/// The options of the connection to Foxglove.
#[derive(Args, Clone, Debug, Default)]
pub struct FoxgloveOptions {
    /// Let Foxglove connect here, at ws://127.0.0.1:8765 unless an address is given
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = DEFAULT)]
    pub foxglove: Option<String>,
}

impl FoxgloveOptions {
    /// Serves Foxglove, if the user asked for it.
    pub fn serve(&self, session: &str) -> Result<Option<Foxglove>, FoxgloveError> {
        self.foxglove.as_ref().map(|address| Foxglove::serve(address, session)).transpose()
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let pair = |address: &String| ["--foxglove".to_owned(), address.clone()];
        self.foxglove.iter().flat_map(pair).collect()
    }
}

/// Publishes all messages to the clients that have subscribed.
///
/// A client that does not keep up loses the oldest messages; the monitor does not wait.
pub struct Foxglove {
    /// The context of channels and server; they do not keep it alive themselves.
    _context: Arc<Context>,
    server: Option<WebSocketServerHandle>,
    channels: [Arc<RawChannel>; TOPICS.len()],
    arm: Channel<SceneUpdate>,
    timeline: Timeline,
    scenario: Option<Arc<Offered>>,
    scene: Option<Scene>,
    has_subscribers: bool,
    state: Option<StateSample>,
    drawn: Instant,
    json: Vec<u8>,
}

impl fmt::Debug for Foxglove {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Foxglove").finish_non_exhaustive()
    }
}

impl Foxglove {
    /// Serves at an address, `HOST:PORT`.
    pub fn serve(address: &str, session: &str) -> Result<Self, FoxgloveError> {
        Self::start(address, session)
            .map_err(|reason| FoxgloveError { address: address.to_owned(), reason })
    }

    fn start(address: &str, session: &str) -> Result<Self, Reason> {
        let (host, port) = address.rsplit_once(':').ok_or(Reason::NoPort)?;
        let port = port.parse().map_err(|_| Reason::Port(port.to_owned()))?;
        let context = Context::new();
        let channel = |topic: Topic| {
            let text = schema(topic).to_string().into_bytes();
            context
                .channel_builder(topic.channel())
                .message_encoding("json")
                .schema(Schema::new(format!("mtj.{}", topic.name()), "jsonschema", text))
                .build_raw()
        };
        let [scenario, state, torque, error, status, request, change, presence] =
            TOPICS.map(channel);
        let channels = [scenario?, state?, torque?, error?, status?, request?, change?, presence?];
        let server = WebSocketServer::new()
            .name(format!("mtj, session {session}"))
            .context(&context)
            .bind(host, port)
            .start_blocking()
            .map_err(Reason::Listen)?;
        info!("Foxglove can connect to ws://{host}:{}", server.port());
        Ok(Self {
            server: Some(server),
            channels,
            arm: context.channel_builder("/mtj/arm").build(),
            _context: context,
            timeline: Timeline::default(),
            scenario: None,
            scene: None,
            has_subscribers: false,
            state: None,
            drawn: Instant::now(),
            json: Vec::new(),
        })
    }

    /// The port at which it listens.
    pub fn port(&self) -> Option<u16> {
        self.server.as_ref().map(WebSocketServerHandle::port)
    }

    fn publish(&mut self, message: &Message) {
        let time = self.timeline.log_time(message, now_ns());
        let channel = &self.channels[Topic::of(message) as usize];
        if !channel.has_sinks() {
            return;
        }
        self.json.clear();
        // Writing to memory cannot fail.
        if write_json(&mut self.json, message).is_ok() {
            channel.log_with_meta(&self.json, PartialMetadata { log_time: Some(time) });
        }
    }

    /// Publishes the scenario again for a client that subscribes after it came.
    fn repeat_scenario(&mut self) {
        let has_subscribers = self.channels[Topic::Scenario as usize].has_sinks();
        if has_subscribers
            && !self.has_subscribers
            && let Some(offered) = self.scenario.clone()
        {
            self.publish(&Message::Scenario(offered));
        }
        self.has_subscribers = has_subscribers;
    }

    fn draw(&mut self) {
        let (Some(scene), Some(state)) = (&self.scene, self.state.take()) else { return };
        let arm = scene.points(&state.position);
        let tip = scene.tip(&state.position);
        let desired = scene.desired(state.header.time_ns as f64 * 1e-9);
        let size = 0.03 * scene.reach();
        let entity = SceneEntity {
            timestamp: Timestamp::try_from(SystemTime::now()).ok(),
            frame_id: "base".to_owned(),
            id: "arm".to_owned(),
            lines: vec![line(&arm, size / 2.0, [0.55, 0.55, 0.55])],
            spheres: vec![
                sphere(desired, size, [0.85, 0.45, 0.0]),
                sphere(tip, size, [0.0, 0.53, 0.84]),
            ],
            ..SceneEntity::default()
        };
        self.arm.log(&SceneUpdate { deletions: Vec::new(), entities: vec![entity] });
    }
}

impl Sink for Foxglove {
    fn handle(&mut self, message: &Message) {
        self.publish(message);
        match message {
            Message::Scenario(offered) => {
                self.scene = Some(Scene::new(&offered.scenario));
                self.scenario = Some(Arc::clone(offered));
            }
            Message::State(state) => self.state = Some(*state),
            _ => {}
        }
    }

    fn refresh(&mut self) -> Result<bool, MonitorError> {
        self.repeat_scenario();
        if self.drawn.elapsed() >= PERIOD && self.arm.has_sinks() {
            self.drawn = Instant::now();
            self.draw();
        }
        Ok(true)
    }
}

impl Drop for Foxglove {
    fn drop(&mut self) {
        if let Some(server) = self.server.take() {
            drop(server.stop());
        }
    }
}

fn now_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64
}

fn color([r, g, b]: [f64; 3]) -> Option<Color> {
    Some(Color { r, g, b, a: 1.0 })
}

fn pose([x, y, z]: Point) -> Option<Pose> {
    Some(Pose {
        position: Some(Vector3 { x, y, z }),
        orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
    })
}

fn line(points: &[Point], thickness: f64, rgb: [f64; 3]) -> LinePrimitive {
    LinePrimitive {
        r#type: line_primitive::Type::LineStrip as i32,
        pose: pose([0.0; 3]),
        thickness,
        points: points.iter().map(|&[x, y, z]| Point3 { x, y, z }).collect(),
        color: color(rgb),
        ..LinePrimitive::default()
    }
}

fn sphere(at: Point, size: f64, rgb: [f64; 3]) -> SpherePrimitive {
    SpherePrimitive {
        pose: pose(at),
        size: Some(Vector3 { x: size, y: size, z: size }),
        color: color(rgb),
    }
}

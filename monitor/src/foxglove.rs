//! Live to Foxglove: every message as JSON over a WebSocket, and the arm for the 3D panel.

use std::{
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
    bus::BusError,
    port::{Message, Offered},
    sample::StateSample,
};

use crate::{
    monitor::Audience,
    recording::{TOPICS, Timeline, Topic, schema, write_json},
};

/// Where Foxglove looks unless it is told otherwise.
const DEFAULT: &str = "127.0.0.1:8765";
/// How often the arm is drawn.
const PERIOD: Duration = Duration::from_millis(50);

/// The options of the connection to Foxglove.
#[derive(Args, Clone, Debug, Default)]
pub struct FoxgloveOptions {
    /// Let Foxglove connect here, at ws://127.0.0.1:8765 unless an address is given
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = DEFAULT)]
    pub foxglove: Option<String>,
}

impl FoxgloveOptions {
    /// Serves, if that was asked for.
    pub fn serve(&self, session: &str) -> Result<Option<Foxglove>, BusError> {
        self.foxglove.as_ref().map(|address| Foxglove::serve(address, session)).transpose()
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let pair = |address: &String| ["--foxglove".to_owned(), address.clone()];
        self.foxglove.iter().flat_map(pair).collect()
    }
}

/// Publishes what it hears, to those who have subscribed to it.
///
/// A client that does not keep up loses the oldest messages; nobody waits for it.
pub struct Foxglove {
    /// What channels and server have in common; they do not keep it alive themselves.
    _context: Arc<Context>,
    server: Option<WebSocketServerHandle>,
    channels: [Arc<RawChannel>; TOPICS.len()],
    arm: Channel<SceneUpdate>,
    timeline: Timeline,
    scenario: Option<Arc<Offered>>,
    scene: Option<Scene>,
    is_followed: bool,
    state: Option<StateSample>,
    drawn: Instant,
    json: Vec<u8>,
}

impl Foxglove {
    /// Serves at an address, `HOST:PORT`.
    pub fn serve(address: &str, session: &str) -> Result<Self, BusError> {
        let refuse =
            |why: String| {
                BusError::Settings(format!(
                "--foxglove {address}: {why}; expected an address to listen on, like {DEFAULT}"
            ).into())
            };
        let (host, port) =
            address.rsplit_once(':').ok_or_else(|| refuse("there is no port".to_owned()))?;
        let port = port.parse().map_err(|_| refuse(format!("'{port}' is no port")))?;
        let context = Context::new();
        let mut channels = Vec::new();
        for topic in TOPICS {
            let text = schema(topic).to_string().into_bytes();
            let channel = context
                .channel_builder(topic.channel())
                .message_encoding("json")
                .schema(Schema::new(format!("mtj.{}", topic.name()), "jsonschema", text))
                .build_raw();
            channels.push(channel.map_err(|error| refuse(error.to_string()))?);
        }
        let channels =
            channels.try_into().map_err(|_| refuse("channels are missing".to_owned()))?;
        let server = WebSocketServer::new()
            .name(format!("mtj, session {session}"))
            .context(&context)
            .bind(host, port)
            .start_blocking()
            .map_err(|error| refuse(format!("cannot listen there ({error})")))?;
        eprintln!("mtj monitor: Foxglove can connect to ws://{host}:{}", server.port());
        Ok(Self {
            server: Some(server),
            channels,
            arm: context.channel_builder("/mtj/arm").build(),
            _context: context,
            timeline: Timeline::default(),
            scenario: None,
            scene: None,
            is_followed: false,
            state: None,
            drawn: Instant::now(),
            json: Vec::new(),
        })
    }

    /// Where it listens.
    pub fn port(&self) -> Option<u16> {
        self.server.as_ref().map(WebSocketServerHandle::port)
    }

    fn publish(&mut self, message: &Message) {
        let time = self.timeline.place(message, now_ns());
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

    /// Tells the scenario again to those who come when it has been told.
    fn welcome(&mut self) {
        let is_followed = self.channels[Topic::Scenario as usize].has_sinks();
        if is_followed
            && !self.is_followed
            && let Some(offered) = self.scenario.clone()
        {
            self.publish(&Message::Scenario(offered));
        }
        self.is_followed = is_followed;
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

impl Audience for Foxglove {
    fn hear(&mut self, message: &Message) {
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

    fn refresh(&mut self) -> Result<bool, BusError> {
        self.welcome();
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

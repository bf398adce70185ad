//! The page's server without a browser: speed, sharing, limits, and what it makes of those who mean it ill.

#![expect(clippy::print_stdout, reason = "figures are for those who ask for them")]

mod viewing;

use std::time::{Duration, Instant};

use serde_json::json;
use viewing::{Client, PATIENCE, Served, judge};

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn the_first_state_comes_at_once_and_the_first_picture_after_it() {
    let served = Served::start("cornell --listen 127.0.0.1:0");
    let mut client = Client::connect(&served);
    client.wait("the controls", |c| c.viewers["you"].is_u64() && c.viewers["holder"] == c.viewers["you"]);
    // What plays never stands still.
    client.input(json!({"do": "play", "playing": false}));
    client.input(json!({"do": "size", "width": 160, "height": 120}));
    let shown = client.picture("a picture of that size", |p| p.number("width") == 160.0 && p.is("still"));
    let jpeg = shown.header["kind"] == "image/jpeg";
    assert_eq!(shown.bytes.starts_with(&[0xFF, 0xD8]), jpeg, "{}", shown.header);
    let best = client.picture("a lossless one", |p| p.header["kind"] == "image/png");
    assert_eq!(&best.bytes[1..4], b"PNG");
}

/// What streaming a scene costs.
struct Figures {
    /// Pictures that arrived, of those that were made.
    arrived: f64,
    /// Pictures per second that arrived, of those that the engine alone would make.
    of_engine: f64,
    /// The quickest packing, milliseconds: that which nothing else disturbed.
    encode: f64,
    /// Medians, milliseconds: rendering, and from an input to the picture that shows it.
    frame: f64,
    latency: f64,
}

fn stream(scene: &str, [width, height]: [u32; 2], seconds: u64) -> Figures {
    let served = Served::start(&format!("{scene} --listen 127.0.0.1:0"));
    let mut client = Client::connect(&served);
    client.picture("a picture", |_| true);
    for input in [
        json!({"do": "play", "playing": false}),
        json!({"do": "goal", "frames_per_second": null}),
        json!({"do": "size", "width": width, "height": height}),
        // A key that is held moves the view all the time.
        json!({"do": "mode", "mode": "fly"}),
        json!({"do": "drive", "way": [0.02, 0.0, 0.0]}),
    ] {
        client.input(input);
    }
    client.picture("movement", |p| !p.is("still") && p.number("width") == f64::from(width));
    let (mut shown, start) = (Vec::new(), Instant::now());
    while start.elapsed() < Duration::from_secs(seconds) {
        shown.extend(client.hear().expect("a connection"));
    }
    let (first, last) = (&shown[0], shown.last().expect("pictures"));
    let count = (shown.len() - 1) as f64;
    let renders: Vec<f64> = shown.iter().map(|p| p.header["stats"]["render"].as_f64().expect("ms")).collect();
    let mean = renders[1..].iter().sum::<f64>() / count;
    let frame = median(renders);

    client.input(json!({"do": "drive", "way": [0.0, 0.0, 0.0]}));
    let mut latencies = Vec::new();
    for i in 0..15 {
        std::thread::sleep(Duration::from_millis(40 + 13 * (i % 4)));
        let sent = Instant::now();
        let number = client.input(json!({"do": "pan", "by": [0.002, 0.0]})) as f64;
        let picture = client.picture("its picture", |p| p.number("input") >= number);
        latencies.push((picture.at - sent).as_secs_f64() * 1e3);
    }
    let figures = Figures {
        arrived: count / (last.number("number") - first.number("number")).max(1.0),
        of_engine: count / (last.at - first.at).as_secs_f64() * mean * 1e-3,
        encode: shown.iter().map(|p| p.number("encode")).fold(f64::INFINITY, f64::min),
        frame,
        latency: median(latencies),
    };
    let Figures { arrived, of_engine, encode, frame, latency } = figures;
    println!(
        "{scene} {width}×{height}: {count} pictures, {:.1} % of those made, {:.1} % of the engine's rate; \
         {frame:.1} ms to render, {encode:.2} ms to pack at best, {latency:.1} ms from input to picture",
        100.0 * arrived,
        100.0 * of_engine
    );
    figures
}

/// Pictures arrive as fast as the engine makes them, and what one does is seen soon.
#[test]
fn pictures_are_streamed_as_fast_as_they_are_made() {
    let figures = stream("cornell", [320, 240], 4);
    // Other tests run beside this one; the rule itself is held where nothing else runs, see below.
    assert!(figures.arrived >= 0.9, "{}", figures.arrived);
    assert!(figures.latency <= 10.0 * (1.5 * figures.frame + 10.0), "{}", figures.latency);
}

/// `cargo test --release --workspace --test serve -- --ignored conference --nocapture`, on a machine that does nothing else.
#[test]
#[ignore = "needs a machine that does nothing else"]
fn the_conference_room_is_streamed_at_the_rate_of_the_engine() {
    let figures = stream("conference", [640, 480], 20);
    let Figures { arrived, of_engine, encode, frame, latency } = figures;
    let most = 1.5 * frame + 10.0;
    judge(
        "streaming the conference room",
        &[
            (format!("{:.1} % of the engine's rate arrive (95 %)", 100.0 * of_engine), of_engine >= 0.95),
            (format!("{:.1} % of the pictures made arrive (95 %)", 100.0 * arrived), arrived >= 0.95),
            (format!("{encode:.2} ms to pack a picture (3 ms)"), encode <= 3.0),
            (format!("{latency:.1} ms from input to picture ({most:.1} ms)"), latency <= most),
        ],
    );
}

/// A hilly landscape of a million triangles, as a binary PLY file.
fn million_triangles() -> String {
    let (columns, rows) = (1001_u32, 501_u32);
    let head = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        columns * rows,
        2 * (columns - 1) * (rows - 1)
    );
    let mut bytes = head.into_bytes();
    for i in 0..columns * rows {
        let (x, z) = ((i % columns) as f32 * 0.1, (i / columns) as f32 * 0.1);
        let y = 2.0 * (0.2 * x).sin() * (0.3 * z).cos() + 0.3 * (2.1 * x + z).sin();
        [x, y, z].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    for i in 0..(columns - 1) * (rows - 1) {
        let corner = i / (columns - 1) * columns + i % (columns - 1);
        for triangle in
            [[corner, corner + columns, corner + 1], [corner + 1, corner + columns, corner + columns + 1]]
        {
            bytes.push(3);
            triangle.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        }
    }
    let file = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("million.ply");
    std::fs::write(&file, bytes).expect("a file");
    file.display().to_string()
}

/// `cargo test --release --workspace --test serve -- --ignored million --nocapture`, on a machine that does nothing else;
/// `HELIOSTAT_LARGE_SCENE` names another scene than a landscape of exactly so many triangles.
#[test]
#[ignore = "needs a machine that does nothing else"]
fn a_million_triangles_are_seen_within_three_seconds() {
    let scene = std::env::var("HELIOSTAT_LARGE_SCENE").unwrap_or_else(|_| million_triangles());
    let start = Instant::now();
    let served = Served::start(&format!("{scene} --listen 127.0.0.1:0"));
    let mut client = Client::connect(&served);
    client.wait("progress", |c| c.state["loading"].is_object() || c.state["scene"].is_object());
    let told = start.elapsed();
    client.picture("a picture", |_| true);
    let seen = start.elapsed();
    judge(
        &format!("the first picture of {scene}"),
        &[
            (format!("progress is told after {told:.2?} (200 ms)"), told < Duration::from_millis(200)),
            (format!("the first picture comes after {seen:.2?} (3 s)"), seen < Duration::from_secs(3)),
        ],
    );
}

#[test]
fn ten_thousand_malformed_messages_are_refused_and_the_server_lives() {
    let mut served = Served::start("cornell --listen 127.0.0.1:0");
    let mut seed = 1_u64;
    let mut random = move |n: u64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) % n
    };
    let mut sent = 0;
    while sent < 10_000 {
        let mut client = Client::connect(&served);
        for _ in 0..900 {
            let length = random(200) as usize;
            let said = match random(7) {
                0 => client.say_bytes((0..length).map(|_| random(256) as u8).collect()),
                1 => client.say(&"[".repeat(60_000)),
                2 => {
                    client.say(&format!(r#"{{"input":{{"do":"zoom","steps":{}}}}}"#, "9".repeat(length + 20)))
                }
                3 => client.say(r#"{"input":{"do":"open","path":"/etc/passwd"}}"#),
                4 => client.say(r#"{"input":{"do":"view","text":7},"number":-1}"#),
                5 => client.say(&"\u{FFFD}x\"{".repeat(length)),
                _ => client.say(r#"{"give":true}"#),
            };
            sent += 1;
            if said.is_err() || sent >= 10_000 {
                break;
            }
        }
        // What it has to say to that.
        for _ in 0..3 {
            _ = client.hear();
        }
    }
    assert!(served.is_alive());
    let mut client = Client::connect(&served);
    client.picture("a picture after all that", |_| true);
    // Too long for a message: the connection ends, the server does not.
    let mut rude = Client::connect(&served);
    _ = rude.say(&"x".repeat(1 << 20));
    let start = Instant::now();
    while rude.hear().is_ok() {
        assert!(start.elapsed() < PATIENCE, "the connection goes on");
    }
    assert!(served.is_alive());
    client.picture("another", |_| true);
}

#[test]
fn who_is_killed_frees_the_place_and_the_controls() {
    let served = Served::start("cornell --listen 127.0.0.1:0");
    let mut clients: Vec<Client> = Vec::new();
    for _ in 0..8 {
        clients.push(Client::connect(&served));
        // On a busy machine this takes a while, and who is silent loses its place.
        clients.iter_mut().for_each(|client| _ = client.hear());
    }
    let mut late = Client::connect(&served);
    let start = Instant::now();
    while late.hear().is_ok() {
        assert!(start.elapsed() < PATIENCE, "a ninth viewer is let in");
    }
    let mut clients = clients.into_iter();
    let first = clients.next().expect("eight");
    let mut second = clients.next().expect("eight");
    second.wait("all eight", |c| c.viewers["all"].as_array().is_some_and(|all| all.len() == 8));
    // The first stops to read and to answer, as if its machine had been switched off; the others go in good order.
    drop(clients);
    let silent = Instant::now();
    second.wait("the controls", |c| c.viewers["holder"] == c.viewers["you"]);
    assert!(silent.elapsed() < Duration::from_secs(7), "{:?}", silent.elapsed());
    second.wait("the place", |c| c.viewers["all"].as_array().is_some_and(|all| all.len() == 1));
    drop(first);
    second.input(json!({"do": "play", "playing": false}));
    second.wait("the pause", |c| c.state["scene"]["playing"] == false);
}

#[test]
fn watchers_change_nothing_and_files_go_to_memory_only() {
    let served = Served::start("cornell --listen 127.0.0.1:0 --max-upload 1");
    let mut holder = Client::connect(&served);
    holder.wait("the controls", |c| c.viewers["holder"].is_u64() && !c.key.is_empty());
    let mut watcher = Client::connect(&served);
    watcher.wait("a place", |c| c.viewers["you"].is_u64() && !c.key.is_empty());
    watcher.input(json!({"do": "renderer", "name": "direct"}));
    watcher.wait("a refusal", |c| c.refused.iter().any(|text| text.contains("another viewer")));

    let host = format!("Host: {}", served.address());
    let upload = |key: &str, name: &str, body: &[u8], more: &str| {
        served.request(&format!("POST /upload?key={key}&name={name} HTTP/1.1\r\n{host}{more}"), body).0
    };
    let triangle = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(upload(&watcher.key, "a.obj", triangle, ""), 403);
    assert_eq!(upload("", "a.obj", triangle, ""), 403);
    assert_eq!(upload(&holder.key, "a.obj", triangle, "\r\nOrigin: http://evil.example"), 403);
    let large = vec![b'#'; (1 << 20) + 1];
    assert_eq!(upload(&holder.key, "a.obj", &large, ""), 413);
    // A material library beside it on the server's disk is not read, whatever the name says.
    let sly = b"mtllib /etc/passwd\nusemtl root\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(upload(&holder.key, "..%2F..%2Fetc%2Fpasswd.obj", sly, ""), 202);
    holder.wait("the scene", |c| c.state["title"] == "passwd.obj");
    let messages = holder.state["messages"].to_string();
    assert!(
        messages.contains("mtllib") || messages.contains("/etc/passwd"),
        "a warning tells so: {messages}"
    );
    holder.picture("a picture of it", |p| p.is("still"));

    let (status, png) = served.get("/picture.png");
    assert_eq!((status, &png[1..4]), (200, &b"PNG"[..]));
    let (status, exr) = served.get("/picture.exr");
    assert_eq!((status, &exr[..4]), (200, &[0x76, 0x2F, 0x31, 0x01][..]));
    for path in ["/../Cargo.toml", "/page/index.html", "/etc/passwd", "/%2e%2e/Cargo.toml"] {
        assert_eq!(served.get(path).0, 404, "{path}");
    }
    let strange = served.request("GET / HTTP/1.1\r\nHost: evil.example", b"");
    assert_eq!(strange.0, 403);
}

#[test]
fn others_need_the_token() {
    let served = Served::start("cornell --listen 0.0.0.0:0");
    let token = served.url.split_once("token=").expect("a token").1.to_owned();
    assert_eq!((token.len(), served.get("/").0, served.get("/?token=0").0), (32, 403, 403));
    assert_eq!(served.get(&format!("/?token={token}")).0, 200);
    let plain = format!("ws://{}/socket", served.address());
    assert!(tungstenite::connect(plain).is_err(), "no token, no session");
    let mut client = Client::connect(&served);
    client.picture("a picture", |_| true);
}

/// Ten minutes of random actions by two clients. `cargo test --release --workspace --test serve -- --ignored soak --nocapture`;
/// `HELIOSTAT_SOAK_SECONDS` shortens it.
#[test]
#[ignore = "takes ten minutes"]
fn soak() {
    let seconds = std::env::var("HELIOSTAT_SOAK_SECONDS").ok().and_then(|s| s.parse().ok()).unwrap_or(600);
    let said = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("soak-stderr.txt");
    let file = std::fs::File::create(&said).expect("a file");
    let mut served = Served::start_with("cornell --listen 127.0.0.1:0", file);
    let mut seed = 7_u64;
    let mut random = move |n: u64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) % n
    };
    let mut clients = [Client::connect(&served), Client::connect(&served)];
    clients[0].input(json!({"do": "size", "width": 200, "height": 150}));
    // Highest memory in the second and in the last fifth of the time: what goes up and down is no growth.
    let (start, mut peaks, mut actions) = (Instant::now(), [0_u64; 5], 0_u64);
    let (mut asked, mut longest) = (0, Duration::ZERO);
    while start.elapsed() < Duration::from_secs(seconds) {
        let who = random(2) as usize;
        if random(400) == 0 {
            // Gone without a word, and somebody new.
            clients[who] = Client::connect(&served);
        }
        let share = |n: u64| n as f64 / 100.0;
        let point = [share(random(100)), share(random(100))];
        let (names, modes) = (["path", "direct", "igi", "cast"], ["orbit", "fly", "walk"]);
        let (looks, effects) = (["show-depth", "show-level", "show-uv"], ["edges", "heat", "vignette"]);
        let planes = [json!("normal"), json!("nodes"), json!("cost"), json!(null), json!(null), json!(null)];
        let action = match random(21) {
            0 => json!({"do": "pointer", "phase": "down", "at": point}),
            1..=3 => json!({"do": "pointer", "phase": "move", "at": point}),
            4 => json!({"do": "pointer", "phase": "up", "at": point}),
            5 => json!({"do": "zoom", "steps": random(5) as f64 - 2.0}),
            6 => json!({"do": "drive", "way": [share(random(100)), 0.0, share(random(100))]}),
            7 => json!({"do": "home"}),
            8 => json!({"do": "renderer", "name": names[random(4) as usize]}),
            9 => json!({"do": "mode", "mode": modes[random(3) as usize]}),
            10 => json!({"do": "play", "playing": random(2) == 0}),
            11 => json!({"do": "seek", "time": share(random(400))}),
            12 => json!({"do": "undo"}),
            13 => json!({"do": "redo"}),
            14 => {
                // Buffers grow with the largest picture so far: it comes again and again, in each fifth of the time.
                let [width, height] =
                    if random(4) == 0 { [300, 230] } else { [100 + random(200), 80 + random(150)] };
                json!({"do": "size", "width": width, "height": height})
            }
            15 => json!({"do": "show", "plane": planes[random(6) as usize]}),
            16 => {
                json!({"do": "change", "gesture": random(9), "change": {"kind": "show", "instance": random(9), "visible": random(4) > 0}})
            }
            17 => json!({"do": "surfaces", "shader": {"name": looks[random(3) as usize]}}),
            18 => json!({"do": "effects", "shaders": [{"name": effects[random(3) as usize]}]}),
            19 => json!({"do": "plain"}),
            _ => json!({"do": "gizmo", "mode": "rotate"}),
        };
        clients[who].input(action);
        actions += 1;
        if random(50) == 0 {
            let give = clients[who].viewers["all"][random(2) as usize].clone();
            _ = clients[who].say(&json!({"ask": random(2) == 0, "give": give}).to_string());
        }
        for client in &mut clients {
            client.hear().expect("nobody is thrown out");
        }
        if random(300) == 0 {
            // What the one with the controls does is seen, whatever went before.
            if let Some(waited) = seen_after(&mut clients) {
                (asked, longest) = (asked + 1, longest.max(waited));
            }
        }
        if actions.is_multiple_of(16) {
            let fifth = (5 * start.elapsed().as_millis() / (1000 * u128::from(seconds))).min(4) as usize;
            peaks[fifth] = peaks[fifth].max(served.memory().unwrap_or(0));
        }
    }
    let alive = served.is_alive();
    let mut fresh = Client::connect(&served);
    fresh.picture("a session that goes on", |_| true);
    let growth = peaks[4] as f64 / peaks[1].max(1) as f64 - 1.0;
    let peaks = peaks.map(|p| p as f64 / 1_048_576.0);
    let text = std::fs::read_to_string(&said).unwrap_or_default();
    println!("{actions} actions in {seconds} s; highest memory in each fifth of the time: {peaks:.1?} MiB");
    judge(
        "the soak",
        &[
            ("the server lives".into(), alive),
            (
                format!(
                    "nothing panicked {}",
                    text.lines().find(|line| line.contains("panicked")).unwrap_or("")
                ),
                !text.contains("panicked"),
            ),
            (
                format!("memory grew by {:+.1} % from the second fifth to the last (5 %)", 100.0 * growth),
                growth <= 0.05,
            ),
            (
                format!("{asked} times a picture was waited for, {longest:.2?} at most (20 s)"),
                asked > 0 && longest < STUCK,
            ),
        ],
    );
}

/// A session that shows nothing of what was done for so long is stuck.
const STUCK: Duration = Duration::from_secs(20);

/// How long it takes until something that the holder of the controls does is seen; `None` when nobody holds them, or no
/// longer.
fn seen_after(clients: &mut [Client; 2]) -> Option<Duration> {
    let holds = |client: &Client| {
        client.viewers["holder"].is_u64() && client.viewers["holder"] == client.viewers["you"]
    };
    let who = clients.iter().position(holds)?;
    let (number, start) =
        (clients[who].input(json!({"do": "pan", "by": [0.01, 0.0]})) as f64, Instant::now());
    while start.elapsed() < STUCK {
        for (i, client) in clients.iter_mut().enumerate() {
            let shown = client.hear().expect("nobody is thrown out");
            if i == who && shown.is_some_and(|shown| shown.number("input") >= number) {
                return Some(start.elapsed());
            }
        }
        if !holds(&clients[who]) {
            return None;
        }
    }
    Some(start.elapsed())
}

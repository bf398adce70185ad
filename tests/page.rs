//! The page in a real browser: it shows pictures, and what is done in it has its effect. Screenshots of the states lie in
//! the target folder's `tmp/screenshots`.

mod viewing;

use serde_json::json;
use viewing::Served;
use viewing::browser::{Browser, Tab, chromium};

/// Mean brightness of the picture's three channels.
const MEANS: &str = "(() => { const c = document.getElementById('picture'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
    const s = [0, 0, 0]; for (let i = 0; i < d.length; i += 4) for (let k = 0; k < 3; k++) s[k] += d[i + k]; return s.map(v => v / (d.length / 4)); })()";

fn means(tab: &Tab<'_>) -> [f64; 3] {
    let value = tab.value(MEANS);
    [0, 1, 2].map(|i| value[i].as_f64().expect("a number"))
}

fn wait_for_still(tab: &Tab<'_>) {
    tab.wait("heliostat.header?.still && heliostat.header.frames >= 2");
}

/// Waits for a still picture that shows everything done so far: the numbers of pictures grow.
fn wait_for_next_still(tab: &Tab<'_>) {
    tab.value("window.seen = heliostat.header.number");
    tab.wait("heliostat.header.number > seen && heliostat.header.still && heliostat.header.frames >= 2 && heliostat.header.input > 0");
}

/// Chooses something from a list.
fn choose(tab: &Tab<'_>, id: &str, value: &str) {
    tab.value(&format!(
        "(() => {{ const f = document.getElementById('{id}'); f.value = '{value}'; f.dispatchEvent(new Event('input')); }})()"
    ));
}

/// Where a point of the picture is on the page.
fn on_page(tab: &Tab<'_>, x: f64, y: f64) -> [f64; 2] {
    let find = "(() => { const b = document.getElementById('picture').getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })()";
    let b = tab.value(find);
    let n = |i: usize| b[i].as_f64().expect("a number");
    [n(0) + x * n(2), n(1) + y * n(3)]
}

#[test]
fn a_user_looks_around_picks_changes_plays_and_switches() {
    let Some(program) = chromium() else { return };
    let served = Served::start("cornell --listen 127.0.0.1:0");
    let browser = Browser::start(&program, "user");
    let tab = browser.open(&served.url, 760, 480);
    // The first frame; the clip plays.
    tab.wait("window.heliostat?.pictures > 0");
    tab.value("window.moment = heliostat.header.time");
    tab.wait("heliostat.header.time !== moment");
    tab.screenshot("1-playing");
    tab.value("document.getElementById('play').click()");
    wait_for_still(&tab);
    tab.value("(() => { const t = document.getElementById('time'); t.value = 0; t.dispatchEvent(new Event('input')); })()");
    wait_for_next_still(&tab);
    assert!(means(&tab).iter().sum::<f64>() > 60.0, "a picture, not black: {:?}", means(&tab));
    tab.screenshot("2-still");

    // Dragging turns the view.
    let view = tab.value("heliostat.header.view");
    let before = tab.value("document.getElementById('picture').toDataURL()");
    tab.drag(on_page(&tab, 0.3, 0.8), on_page(&tab, 0.42, 0.75));
    wait_for_next_still(&tab);
    assert_ne!(tab.value("heliostat.header.view"), view);
    assert_ne!(tab.value("document.getElementById('picture').toDataURL()"), before);
    tab.wait("location.hash.includes('view=')");
    tab.screenshot("3-turned");
    tab.value("document.getElementById('home').click()");
    wait_for_next_still(&tab);

    // Pick the ceiling lamp, make it shine red, move it down by its handle.
    tab.click(on_page(&tab, 0.5, 0.14));
    tab.wait("heliostat.state.scene.selection?.name === 'lamp'");
    tab.screenshot("4-picked");
    let before = means(&tab);
    tab.value("(() => { const f = document.getElementById('m-glow'); f.value = '#ff0000'; f.dispatchEvent(new Event('input')); })()");
    tab.wait("heliostat.state.scene.undo === 'material'");
    wait_for_next_still(&tab);
    let red = means(&tab);
    assert!(red[0] / (red[1] + red[2]) > 2.0 * before[0] / (before[1] + before[2]), "{before:?} {red:?}");
    let place = "heliostat.state.scene.selection.parent_from_object[10]";
    let height = tab.value(place).as_f64().expect("a number");
    let handle = tab.value("heliostat.header.lines.find(l => l.kind === 'y').points");
    let point = |i: usize| [0, 1].map(|k| handle[i][k].as_f64().expect("a number"));
    let [foot, tip] = [point(0), point(1)];
    let middle = [0, 1].map(|k| 0.4 * foot[k] + 0.6 * tip[k]);
    let down = [middle[0] - 0.5 * (tip[0] - foot[0]), middle[1] - 1.4 * (tip[1] - foot[1])];
    tab.drag(on_page(&tab, middle[0], middle[1]), on_page(&tab, down[0], down[1]));
    tab.wait("heliostat.state.scene.undo === 'move object'");
    wait_for_next_still(&tab);
    assert!(tab.value(place).as_f64().expect("a number") < height - 0.02);
    tab.screenshot("5-lamp-moved");
    for _ in 0..2 {
        tab.value("document.getElementById('undo').click()");
    }
    tab.wait("heliostat.state.scene.undo === null");

    // Saving, and recording what happens.
    for id in ["save-png", "save-exr", "save-replay"] {
        tab.value(&format!("document.getElementById('{id}').click()"));
    }
    tab.wait("document.getElementById('messages').textContent.includes('saved cornell.replay.json')");
    tab.value("document.getElementById('record').click()");
    tab.wait("heliostat.state.scene.recording");
    tab.drag(on_page(&tab, 0.5, 0.9), on_page(&tab, 0.52, 0.9));
    tab.value("document.getElementById('record').click()");
    tab.wait("!heliostat.state.scene.recording");
    let keys = tab.value("fetch('/replay.json').then(r => r.json()).then(r => r.keys.length)");
    assert!(keys.as_u64() >= Some(2), "{keys} views recorded");
    assert!(tab.value("heliostat.state.scene.recorded").as_f64() > Some(0.0));
    tab.value("document.getElementById('forget').click()");
    tab.wait("heliostat.state.scene.recorded === null && document.getElementById('forget').hidden");
    assert_eq!(tab.value("fetch('/replay.json').then(r => r.json()).then(r => r.keys.length)"), 1);

    // Other renderers and planes.
    for (id, value, check) in [
        ("renderer", "direct", "heliostat.state.scene.renderer === 'direct'"),
        ("plane", "normal", "heliostat.state.scene.plane === 'normal'"),
    ] {
        choose(&tab, id, value);
        tab.wait(check);
        tab.wait("heliostat.header.still");
        std::thread::sleep(std::time::Duration::from_millis(500));
        tab.screenshot(&format!("6-{value}"));
    }

    // False colours, filters with their parameters, tone curves; and the picture as it is again.
    tab.value("document.getElementById('plain').click()");
    tab.wait("heliostat.state.scene.plane === null && document.getElementById('plain').disabled");
    choose(&tab, "surfaces", "show-depth");
    tab.wait("heliostat.state.scene.surfaces?.parameters.far > 0.5 && heliostat.header.exposure === 0");
    wait_for_next_still(&tab);
    tab.screenshot("6-false-depth");
    choose(&tab, "surfaces", "");
    choose(&tab, "effect", "edges");
    tab.wait("heliostat.state.scene.effects[0]?.name === 'edges' && heliostat.state.scene.surfaces === null");
    wait_for_next_still(&tab);
    let lines = means(&tab);
    tab.value("(() => { const f = document.querySelector('#effect-fields [data-parameter=paper]'); f.value = 1; f.dispatchEvent(new Event('input')); })()");
    tab.wait("heliostat.state.scene.effects[0].parameters?.paper === 1");
    wait_for_next_still(&tab);
    assert!(means(&tab)[0] > 1.2 * lines[0], "white paper: {lines:?} {:?}", means(&tab));
    tab.screenshot("6-edges");
    choose(&tab, "effect", "heat");
    tab.wait("heliostat.state.scene.effects.length === 2");
    tab.value("document.querySelector('#effect-fields button').click()");
    tab.wait(
        "heliostat.state.scene.effects.length === 1 && heliostat.state.scene.effects[0].name === 'heat'",
    );
    choose(&tab, "tone", "agx");
    tab.wait("heliostat.state.scene.tone?.name === 'agx'");
    wait_for_next_still(&tab);
    tab.screenshot("6-heat");
    tab.value("document.getElementById('plain').click()");
    tab.wait("heliostat.state.scene.tone === null && heliostat.state.scene.effects.length === 0");

    // Help, by its key; the page says what it is to those who cannot see it.
    tab.click(on_page(&tab, 0.9, 0.9));
    tab.key("Slash", "?");
    tab.wait("document.getElementById('help').open");
    tab.screenshot("7-help");
    let unlabelled = "[...document.querySelectorAll('button, input, select, canvas')].filter(e => !(e.labels?.length || e.textContent.trim() || e.getAttribute('aria-label') || e.closest('[aria-hidden]'))).map(e => e.id)";
    assert_eq!(tab.value(unlabelled), json!([]), "controls without a label");
}

#[test]
fn two_browsers_share_a_session_and_a_phone_is_large_enough() {
    let Some(program) = chromium() else { return };
    let served = Served::start("cornell --listen 127.0.0.1:0");
    let browser = Browser::start(&program, "two");
    let first = browser.open(&served.url, 700, 450);
    first.wait("window.heliostat?.pictures > 0");
    first.value("document.getElementById('play').click()");
    let second = browser.open(&served.url, 390, 760);
    second.resize(390, 760, true);
    second.call("Emulation.setTouchEmulationEnabled", json!({"enabled": true, "maxTouchPoints": 2}));
    second.wait("window.heliostat?.pictures > 0 && heliostat.company?.all.length === 2");
    assert_eq!(second.value("document.getElementById('watching').hidden"), false);
    // The picture was made for another window: it keeps its shape.
    second.wait("Math.abs(heliostat.box[2] / heliostat.box[3] - heliostat.header.width / heliostat.header.height) < 0.1");
    second.screenshot("8-phone-watching");
    second.value("document.getElementById('ask').click()");
    first.wait("heliostat.company.asking.length === 1");
    first.screenshot("9-asked");
    first.value("document.querySelector('#viewers button').click()");
    second.wait("heliostat.company.holder === heliostat.company.you");
    wait_for_still(&second);

    // One finger turns, two shift and go nearer.
    let view = second.value("heliostat.header.view");
    second.fingers(&[on_page(&second, 0.4, 0.8)], &[on_page(&second, 0.6, 0.8)]);
    second.value(&format!("window.before = {view}"));
    second.wait("heliostat.header.view !== before");
    wait_for_still(&second);
    let distance =
        |tab: &Tab<'_>| tab.value("+heliostat.header.view.split(',')[7]").as_f64().expect("a number");
    let far = distance(&second);
    // As on a busy machine: the page draws no frame between what fingers do and their end.
    second.value("window.requestAnimationFrame = () => 0");
    let pinch = |x: f64| [on_page(&second, 0.5 - x, 0.5), on_page(&second, 0.5 + x, 0.5)];
    second.fingers(&pinch(0.1), &pinch(0.3));
    second.value(&format!("window.far = {far}"));
    second.wait("+heliostat.header.view.split(',')[7] < 0.6 * far");
    assert_eq!(second.value("document.documentElement.scrollWidth <= innerWidth"), true);
    second.screenshot("10-phone-nearer");
    // Both see the same view, once all that the fingers did is shown.
    second.wait("heliostat.header.still");
    let view = second.value("heliostat.header.view");
    first.value(&format!("window.view = {view}"));
    first.wait("heliostat.header.view === view");
}

#[test]
fn the_page_comes_back_after_the_server_and_opens_dropped_files() {
    let Some(program) = chromium() else { return };
    let served = Served::start("cornell --listen 127.0.0.1:0");
    let (url, port) = (served.url.clone(), served.port());
    let browser = Browser::start(&program, "again");
    let tab = browser.open(&url, 600, 400);
    tab.wait("window.heliostat?.pictures > 0");
    drop(served);
    tab.wait("document.getElementById('status').textContent.includes('trying again')");
    tab.screenshot("11-lost");
    tab.value("window.seen = heliostat.pictures");
    let _again = Served::start(&format!("cornell --listen 127.0.0.1:{port}"));
    tab.wait("heliostat.pictures > seen + 2 && heliostat.company?.holder === heliostat.company?.you");

    // A file dropped on the picture becomes the scene.
    let text = "v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\n";
    tab.value(&format!(
        "(() => {{ const t = new DataTransfer(); t.items.add(new File(['{text}'], 'triangle.obj')); \
         document.getElementById('stage').dispatchEvent(new DragEvent('drop', {{ dataTransfer: t, bubbles: true }})); }})()"
    ));
    tab.wait("heliostat.state.title === 'triangle.obj' && heliostat.state.scene.thing_count === 1");
    wait_for_still(&tab);
    tab.screenshot("12-dropped");
    // So does one with what it refers to, as dragged out of a folder.
    let material = "newmtl red\\nKd 1 0 0\\n";
    let text = format!("mtllib colours/m.mtl\\nusemtl red\\n{text}");
    tab.value(&format!(
        "(() => {{ const t = new DataTransfer(); t.items.add(new File(['{material}'], 'm.mtl')); t.items.add(new File(['{text}'], 'red.obj')); \
         document.getElementById('stage').dispatchEvent(new DragEvent('drop', {{ dataTransfer: t, bubbles: true }})); }})()"
    ));
    tab.wait("heliostat.state.title === 'red.obj'");
    tab.value("(() => { const t = document.getElementById('thing'); t.value = t.options[1].value; t.dispatchEvent(new Event('input')); })()");
    tab.wait("heliostat.state.scene.selection?.look?.base_color[1] < 0.1");
    // A broken one does not.
    tab.value(
        "(() => { const t = new DataTransfer(); t.items.add(new File(['glTF'], 'broken.glb')); \
         document.getElementById('stage').dispatchEvent(new DragEvent('drop', { dataTransfer: t, bubbles: true })); })()",
    );
    tab.wait("document.querySelector('#messages .error')?.textContent.includes('broken.glb')");
    assert_eq!(tab.value("heliostat.state.title"), "red.obj");
    tab.screenshot("13-broken");
    tab.call(
        "Emulation.setEmulatedMedia",
        json!({"features": [{"name": "prefers-color-scheme", "value": "dark"}]}),
    );
    tab.screenshot("14-dark");
}

/// A floor with a bulb above it, in one file.
fn floor() -> serde_json::Value {
    let place = json!({"KHR_lights_punctual": {"light": 0}});
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"name": "bulb", "type": "point", "intensity": 300}]}},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"name": "floor", "mesh": 0}, {"name": "bulb", "translation": [0, 1, 0], "extensions": place}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-2, 0, -2], "max": [2, 0, 2]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "buffers": [{"byteLength": 60, "uri": "data:application/octet-stream;base64,AAAAwAAAAAAAAABAAAAAQAAAAAAAAABAAAAAQAAAAAAAAADAAAAAwAAAAAAAAADAAAABAAIAAAACAAMA"}]
    })
}

/// What somebody does who has read nothing: drops a glTF file, clicks its lamp, pulls it, saves the picture.
#[test]
fn a_new_user_opens_a_gltf_file_moves_its_lamp_and_saves_a_picture() {
    let Some(program) = chromium() else { return };
    let served = Served::start("--listen 127.0.0.1:0");
    let browser = Browser::start(&program, "new");
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("downloads");
    _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    browser.save_into(&folder);
    let tab = browser.open(&served.url, 1000, 620);
    tab.wait("window.heliostat?.pictures > 0");
    tab.screenshot("16-new-user-start");
    tab.value(&format!(
        "(() => {{ const t = new DataTransfer(); t.items.add(new File([JSON.stringify({})], 'floor.gltf')); \
         document.getElementById('stage').dispatchEvent(new DragEvent('drop', {{ dataTransfer: t, bubbles: true }})); }})()",
        floor()
    ));
    tab.wait("heliostat.state.title === 'floor.gltf' && heliostat.state.scene?.lights.length === 1");
    wait_for_still(&tab);
    // The lamp's mark is there to be clicked.
    let mark = tab.value("heliostat.header.lines.filter(l => l.kind === 'light')[0].points");
    let points = mark.as_array().expect("points");
    let middle = [0, 1].map(|k| {
        let sum: f64 = points.iter().map(|point| point[k].as_f64().expect("a number")).sum();
        sum / points.len() as f64
    });
    tab.click(on_page(&tab, middle[0], middle[1]));
    tab.wait("heliostat.state.scene.selection?.type === 'light' && heliostat.header.lines.some(l => l.kind === 'y')");
    wait_for_still(&tab);
    tab.screenshot("17-new-user-lamp");
    let before = tab.value("document.getElementById('picture').toDataURL()");
    let place = tab.value("heliostat.state.scene.lights[0].lamp.position[0]").as_f64().expect("a number");
    let handle = tab.value("heliostat.header.lines.find(l => l.kind === 'x').points");
    let point = |i: usize| [0, 1].map(|k| handle[i][k].as_f64().expect("a number"));
    let [foot, tip] = [point(0), point(1)];
    let grip = [0, 1].map(|k| 0.4 * foot[k] + 0.6 * tip[k]);
    let there = [0, 1].map(|k| grip[k] + 0.8 * (tip[k] - foot[k]));
    tab.drag(on_page(&tab, grip[0], grip[1]), on_page(&tab, there[0], there[1]));
    tab.wait(&format!("Math.abs(heliostat.state.scene.lights[0].lamp.position[0] - {place}) > 0.05"));
    wait_for_next_still(&tab);
    assert_ne!(tab.value("document.getElementById('picture').toDataURL()"), before);
    tab.screenshot("18-new-user-moved");
    tab.value("document.getElementById('save').click()");
    let start = std::time::Instant::now();
    let saved = || {
        let files = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        // A browser may make the file before it has its content.
        let whole = |path: &std::path::PathBuf| std::fs::metadata(path).is_ok_and(|data| data.len() > 8);
        files
            .map(|file| file.path())
            .find(|path| path.extension().is_some_and(|end| end == "png") && whole(path))
    };
    while saved().is_none() {
        assert!(start.elapsed() < viewing::PATIENCE, "no picture was saved");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let bytes = std::fs::read(saved().expect("a file")).expect("it can be read");
    assert_eq!(&bytes[1..4], b"PNG");
}

/// The picture in the README.
#[test]
fn the_atrium_by_evening_greets_new_users() {
    let Some(program) = chromium() else { return };
    let served = Served::start("--listen 127.0.0.1:0");
    let browser = Browser::start(&program, "readme");
    let tab = browser.open(&served.url, 960, 600);
    // Something is said while it is opened.
    tab.wait("window.heliostat?.state?.loading || window.heliostat?.pictures > 0");
    tab.wait("window.heliostat?.pictures > 3 && heliostat.header.time > 0.1");
    tab.value("document.getElementById('play').click()");
    tab.wait("heliostat.state.scene.playing === false");
    tab.value("(() => { const t = document.getElementById('time'); t.value = 3.5; t.dispatchEvent(new Event('input')); })()");
    tab.value("(() => { const l = document.getElementById('light'); l.value = l.options[1].value; l.dispatchEvent(new Event('input')); })()");
    tab.wait("heliostat.header.still && heliostat.header.frames >= 6 && heliostat.state.scene.selection?.type === 'light'");
    // How fast it is depends on the machine that runs this test.
    tab.value("document.getElementById('overlay').hidden = true");
    tab.save("15-readme.jpg", json!({"format": "jpeg", "quality": 85}));
}

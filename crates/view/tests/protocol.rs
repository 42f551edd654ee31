//! What the server promises to whoever speaks to it, through a socket as a browser's.

mod served;

use relight_play::glam::Vec3;
use relight_play::scene::animated::Animated;
use relight_play::scene::camera::CameraTrack;
use relight_play::scene::image::{Limits, decode_exr};
use relight_play::scene::sequence::parse_sequence;
use relight_play::{FrameSettings, ShotSettings};
use relight_view::{Exhibit, View, ViewError};
use serde_json::{Value, json};
use served::{Served, Tab, exhibit, get, player, post};
use std::path::Path;

const LAMP: [f64; 3] = [0.2, 0.4, 0.1];

fn lights(intensity: f64) -> Value {
    json!({ "relight_sequence": 1, "lights": [
        { "name": "lamp", "type": "point", "position": LAMP, "intensity": [intensity, intensity, intensity] } ] })
}

fn eye() -> Value {
    json!({ "position": [0.28, 0.28, -0.7], "look_at": [0.28, 0.28, 0.2], "up": [0, 1, 0], "vfov_deg": 40 })
}

fn show(id: u64, moving: bool) -> Value {
    json!({ "id": id, "moving": moving, "width": 32, "height": 18, "camera": eye(), "lights": lights(1.0) })
}

#[test]
fn without_the_token_nothing_is_served() {
    let served = Served::new();
    let url = served.url.clone();
    assert_eq!(get(&url).0, 200);
    assert!(get(&url).1.contains("relight view"));
    assert_eq!(get(&format!("{url}main.js")).0, 200);
    let root = url.rsplitn(3, '/').last().unwrap();
    let wrong = format!("{root}/{}/", "0".repeat(32));
    for refused in [
        wrong.clone(),
        format!("{wrong}main.js"),
        format!("{wrong}socket"),
        format!("{root}/x/"),
    ] {
        // A socket is refused as no socket (400, 426) or for its token.
        let (status, text) = get(&refused);
        assert!([400, 403, 426].contains(&status), "{refused}: {status} {text}");
        assert!(!text.contains("<html"), "{refused}");
    }
    assert_eq!(get(&format!("{root}/")).0, 404);
    assert!(tungstenite::connect(format!("{wrong}socket").replace("http", "ws")).is_err());
    for outside in [
        "..%2f..%2fCargo.toml",
        "%2fetc%2fpasswd",
        "Cargo.toml",
        "..",
        ".%2e",
    ] {
        let (status, text) = get(&format!("{url}{outside}"));
        assert_ne!(status, 200, "{outside}: {text}");
    }
}

#[test]
fn a_page_of_another_site_gets_no_socket() {
    use tungstenite::client::IntoClientRequest;
    let served = Served::new();
    let address = format!("{}socket", served.url).replace("http", "ws");
    let mut request = address.as_str().into_client_request().unwrap();
    request
        .headers_mut()
        .insert("Origin", "http://example.com".parse().unwrap());
    assert!(tungstenite::connect(request).is_err());
}

/// Truth: the player of the library, asked as `relight play` asks it.
#[test]
fn what_is_saved_is_what_play_writes_bit_by_bit() {
    let served = Served::new();
    let (status, bytes) = post(
        &format!("{}render.exr?float", served.url),
        show(0, false).to_string(),
    );
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&bytes));
    let saved = decode_exr("saved", &bytes, &Limits::default()).unwrap();

    let player = player();
    let fixed = |xyz: [f32; 3]| Animated::Constant(Vec3::from_array(xyz));
    let camera = CameraTrack {
        name: String::new(),
        position: fixed([0.28, 0.28, -0.7]),
        look_at: fixed([0.28, 0.28, 0.2]),
        up: fixed([0.0, 1.0, 0.0]),
        vfov_deg: Animated::Constant(40.0),
        aspect: None,
    };
    let sequence = parse_sequence(&lights(1.0).to_string(), Path::new(""), "lights").unwrap();
    let lights = player.lights(&sequence.lights).unwrap();
    let settings = ShotSettings {
        width: 32,
        height: 18,
        ..ShotSettings::default()
    };
    let shot = player.shot(&camera.at(0.0), &settings).unwrap();
    let frame = player
        .frame(&shot, &lights, 0.0, &FrameSettings::default())
        .unwrap();
    for layer in ["beauty", "direct", "indirect"] {
        let (mine, theirs) = (frame.layers.rgb(layer).unwrap(), saved.rgb(layer).unwrap());
        assert_eq!(mine, theirs, "{layer}");
        assert!(mine.pixels.iter().any(|p| p[1] > 0.0), "{layer} is black");
    }
}

/// Truth: the same frame, encoded by the library.
#[test]
fn at_rest_the_picture_is_refined_to_the_end_without_loss() {
    use relight_play::scene::image::decode_ldr;
    use relight_play::scene::image::preview::tone_mapped;
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    tab.send(&json!({ "show": show(7, false) }));
    let (head, file) = tab.picture_at("final");
    assert_eq!(
        (head["id"].as_u64(), &head["format"]),
        (Some(7), &json!("image/png"))
    );
    let shown = decode_ldr("shown", &file, &Limits::default()).unwrap();
    let (_, bytes) = post(
        &format!("{}render.exr?float", served.url),
        show(0, false).to_string(),
    );
    let saved = decode_exr("saved", &bytes, &Limits::default()).unwrap();
    assert_eq!(shown.rgba8, tone_mapped(&saved.rgb("beauty").unwrap(), 0.0).rgba8);
}

#[test]
fn the_newest_wish_wins_and_what_moves_is_coarse() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    for id in 1..=300 {
        tab.send(&json!({ "show": show(id, true) }));
    }
    let mut pictures = 0;
    loop {
        let (head, _) = tab.picture();
        pictures += 1;
        assert_eq!(
            (&head["stage"], &head["format"]),
            (&json!("coarse"), &json!("image/jpeg"))
        );
        assert!(head["width"].as_u64().unwrap() <= 32);
        if head["id"] == 300 {
            break;
        }
    }
    assert!(pictures < 300, "{pictures} pictures of 300 wishes");
    assert!(tab.silent(), "a wish that moves is not refined");
}

#[test]
fn garbage_is_answered_in_words_and_ends_only_who_sends_nothing_else() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    let mut wrong = vec![
        json!("{").to_string(),
        "{".into(),
        "null".into(),
        json!({ "show": { "id": 1 } }).to_string(),
        json!({ "open": "/etc/passwd" }).to_string(),
    ];
    for (key, value) in [
        ("width", json!(0)),
        ("width", json!(1_000_000)),
        ("height", json!(-3)),
        ("time", json!(-1)),
        ("exposure", json!(1e9)),
        ("by", json!("magic")),
        (
            "camera",
            json!({ "position": [1e300, 0, 0], "look_at": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 40 }),
        ),
        (
            "camera",
            json!({ "position": [0, 0, 0], "look_at": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 360 }),
        ),
    ] {
        let mut broken = show(1, false);
        broken[key] = value;
        wrong.push(json!({ "show": broken }).to_string());
    }
    for text in wrong {
        tab.send_text(&text);
        assert!(!tab.refused().is_empty(), "{text}");
    }
    // These are wishes, but none that there could be a picture of.
    for lights in [
        json!({ "relight_sequence": 1, "lights": [ { "name": "sky", "type": "environment", "file": "/etc/passwd" } ] }),
        json!({ "relight_sequence": 1, "lights": [ { "name": "a", "type": "lamp" } ] }),
        json!([]),
    ] {
        let mut broken = show(2, false);
        broken["lights"] = lights;
        tab.send(&json!({ "show": broken }));
        assert!(!tab.refused().is_empty(), "{broken}");
    }
    let mut nothing = show(3, false);
    nothing["layer"] = json!("nonsense");
    tab.send(&json!({ "show": nothing }));
    assert!(tab.refused().contains("nonsense"));
    // Dark, blinding, and with the eye on its target.
    for intensity in [0.0, 1e20] {
        let mut odd = show(4, false);
        odd["lights"] = lights(intensity);
        odd["camera"]["look_at"] = odd["camera"]["position"].clone();
        tab.send(&json!({ "show": odd }));
        tab.picture_at("final");
    }
    tab.send(&json!({ "show": show(5, false) }));
    assert_eq!(tab.picture_at("final").0["id"], 5);

    for _ in 0..100 {
        // It may be sent away before the end.
        let _ = tab.socket.send("nonsense".into());
    }
    assert!(tab.closes());
    let mut other = Tab::open(&served.url);
    other.send(&json!({ "show": show(6, false) }));
    other.picture_at("final");
}

#[test]
fn a_message_beyond_the_bound_closes_the_socket_and_nothing_else() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    let huge = " ".repeat(relight_view::server::MOST_MESSAGE + 1);
    let _ = tab.socket.send(huge.into());
    assert!(tab.closes());
    let (status, _) = post(
        &format!("{}render.exr", served.url),
        " ".repeat(relight_view::server::MOST_MESSAGE + 1),
    );
    assert_eq!(status, 413);
    let mut other = Tab::open(&served.url);
    other.send(&json!({ "show": show(1, false) }));
    other.picture_at("final");
}

#[test]
fn tabs_share_the_player_and_too_many_are_sent_away() {
    let served = Served::new();
    let mut tabs: Vec<Tab> = (0..relight_view::desk::MOST_TABS)
        .map(|_| Tab::open(&served.url))
        .collect();
    let mut late = Tab::connect(&served.url);
    assert!(late.closes());
    for (i, tab) in tabs.iter_mut().enumerate() {
        let mut own = show(i as u64, false);
        own["lights"] = lights(1.0 + i as f64);
        tab.send(&json!({ "show": own }));
    }
    let mut files: Vec<Vec<u8>> = Vec::new();
    for (i, tab) in tabs.iter_mut().enumerate() {
        let (head, file) = tab.picture_at("final");
        assert_eq!(head["id"].as_u64(), Some(i as u64));
        assert!(!files.contains(&file), "tab {i} sees another's lights");
        files.push(file);
    }
    drop(tabs);
    // Their places are free again, as soon as the server has heard of it.
    let again = (0..100).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(20));
        Tab::connect(&served.url).hello().is_some()
    });
    assert!(again);
}

#[test]
fn a_pixel_tells_its_material_and_edits_of_it_show() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    tab.send(&json!({ "show": show(1, false) }));
    let (_, before) = tab.picture_at("final");
    tab.send(&json!({ "pick": { "id": 2, "x": 0.5, "y": 0.5 } }));
    let hit = tab.words("picked")["hit"].clone();
    let material = hit["material"].as_u64().expect("a wall is there");
    assert!(hit["distance"].as_f64().unwrap() > 0.0);
    let mut edited = show(3, false);
    edited["materials"] = json!({ "relight_materials": 1, "edits": [ { "material": material, "base_color": [0.9, 0.1, 0.1] } ] });
    tab.send(&json!({ "show": edited }));
    let (_, red) = tab.picture_at("final");
    assert_ne!(before, red);
    let mut back = show(4, false);
    back["materials"] = json!({ "relight_materials": 1, "edits": [] });
    tab.send(&json!({ "show": back }));
    assert_eq!(tab.picture_at("final").0["id"], 4);
}

#[test]
fn a_map_that_was_dropped_is_a_light() {
    let served = Served::new();
    let hdr = std::fs::read("../../data/window.hdr").unwrap();
    let (status, told) = post(&format!("{}maps/w%20w.hdr", served.url), hdr);
    let told: Value = serde_json::from_slice(&told).unwrap();
    assert_eq!((status, &told["file"]), (200, &json!("w w.hdr")));
    let (status, text) = post(&format!("{}maps/x.hdr", served.url), "no map");
    assert_eq!(status, 422, "{}", String::from_utf8_lossy(&text));
    let mut tab = Tab::open(&served.url);
    let mut lit = show(1, false);
    lit["lights"] = json!({ "relight_sequence": 1, "lights": [ { "name": "sky", "type": "environment", "file": "w w.hdr" } ] });
    tab.send(&json!({ "show": lit }));
    tab.picture_at("final");
}

#[test]
fn layers_are_shown_by_name() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    let mut files: Vec<Vec<u8>> = Vec::new();
    for layer in ["beauty", "direct", "indirect", "albedo", "normal", "depth"] {
        let mut wish = show(1, false);
        wish["layer"] = json!(layer);
        tab.send(&json!({ "show": wish }));
        let (head, file) = tab.picture_at("final");
        assert_eq!(head["layer"], layer);
        assert!(!files.contains(&file), "{layer}");
        files.push(file);
    }
}

/// Truth: indirect light itself, which all levels together are.
#[test]
fn levels_are_shown_one_after_another() {
    let served = Served::new();
    let mut tab = Tab::connect(&served.url);
    let levels = tab.hello().unwrap()["levels"].as_u64().unwrap();
    assert!(levels > 1);
    let mut picture = |layer: String| {
        let mut wish = show(1, false);
        wish["layer"] = json!(layer);
        tab.send(&json!({ "show": wish }));
        tab.picture_at("final").1
    };
    let whole = picture("indirect".into());
    assert_eq!(picture(format!("level.{}", levels - 1)), whole);
    assert_ne!(picture("level.0".into()), whole);
    assert_ne!(picture("detail.1".into()), picture("detail.0".into()));
    // The server keeps nothing of it.
    assert_eq!(picture("indirect".into()), whole);
}

/// Truth: the box's light is known to some per cent, and passes of path tracing only get better.
#[test]
fn path_tracing_refines_beside_and_says_how_far_it_is() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    let mut wish = show(1, false);
    wish["by"] = json!("both");
    tab.send(&json!({ "show": wish }));
    let (head, own) = tab.picture_at("final");
    assert_eq!(head["apart"], Value::Null);
    // A tab that is slow is shown the newest pass alone.
    let (mut noise, mut samples) = (Vec::new(), 0);
    while samples < 32 {
        let (head, reference) = tab.picture();
        assert_eq!(head["stage"], "beside");
        assert_ne!(own, reference);
        let apart = &head["apart"];
        let more = apart["samples"].as_u64().unwrap();
        assert!(more > samples, "{head}");
        samples = more;
        noise.extend(apart["noise"].as_f64());
        if samples >= 32 {
            let (error, bias) = (apart["error"].as_f64().unwrap(), apart["bias"].as_f64().unwrap());
            assert!(error < 0.3 && bias.abs() < 0.2, "{head}");
        }
    }
    assert!(noise[noise.len() - 1] < 0.6 * noise[0], "{noise:?}");
    // Saving doesn't wait for its end, and exposure doesn't begin it anew.
    let (status, _) = post(&format!("{}render.exr", served.url), show(0, false).to_string());
    assert_eq!(status, 200);
    wish["exposure"] = json!(1.0);
    wish["id"] = json!(2);
    tab.send(&json!({ "show": wish }));
    let head = loop {
        let (head, _) = tab.picture_at("beside");
        if head["id"] == 2 {
            break head;
        }
    };
    assert!(head["apart"]["samples"].as_u64().unwrap() > 32, "{head}");
    // Another picture has another reference; one that moves has none.
    // A first pass that is not fetched in time gives way to the second: then another picture is asked for.
    let begins_anew = (3..23).any(|id| {
        wish["camera"]["position"] = json!([0.2, 0.3, -0.7 - 1e-3 * f64::from(id)]);
        wish["id"] = json!(id);
        tab.send(&json!({ "show": wish }));
        let head = loop {
            let (head, _) = tab.picture_at("beside");
            if head["id"] == id {
                break head;
            }
        };
        head["apart"]["samples"] == 1
    });
    assert!(begins_anew);
    wish["moving"] = json!(true);
    wish["id"] = json!(23);
    tab.send(&json!({ "show": wish }));
    while tab.picture().0["id"] != 23 {}
    assert!(tab.silent());
}

/// Truth: each way to map tones makes another picture of the same light.
#[test]
fn tones_are_mapped_as_is_asked_for() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    let mut files: Vec<Vec<u8>> = Vec::new();
    for tone in ["neutral", "filmic", "reinhard", "clipped"] {
        let mut wish = show(1, false);
        wish["tone"] = json!(tone);
        tab.send(&json!({ "show": wish }));
        let (_, file) = tab.picture_at("final");
        assert!(!files.contains(&file), "{tone}");
        files.push(file);
    }
}

/// Truth: functions of points sum to 1, and most links bring light.
#[test]
fn a_place_tells_its_points_and_links() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    tab.send(&json!({ "show": show(1, false) }));
    tab.send(&json!({ "pick": { "id": 2, "x": 0.5, "y": 0.5, "links": true } }));
    let transport = tab.words("picked")["hit"]["transport"].clone();
    let rows = |name: &str| transport[name].as_array().unwrap().clone();
    let number = |row: &Value, i: usize| row[i].as_f64().unwrap();
    let whole: f64 = rows("points").iter().map(|row| number(row, 3)).sum();
    assert!((whole - 1.0).abs() < 1e-4, "{transport}");
    let links = rows("links");
    assert_eq!(transport["of"].as_u64().unwrap() as usize, links.len());
    assert!(
        links.iter().filter(|row| number(row, 3) > 0.0).count() * 2 > links.len(),
        "{transport}"
    );
    assert!(links.is_sorted_by(|a, b| number(a, 3).abs() >= number(b, 3).abs()));
    // Who does not ask is told nothing of it, and what is seen of the sky has none.
    tab.send(&json!({ "pick": { "id": 3, "x": 0.5, "y": 0.5 } }));
    assert_eq!(tab.words("picked")["hit"]["transport"], Value::Null);
}

/// Truth: shares of all light sum to 1, the cut's clusters hold every light that shines there once, and lamps light a wall that they see.
#[test]
fn a_place_tells_its_lightcut() {
    let served = Served::new();
    let mut tab = Tab::open(&served.url);
    tab.send(&json!({ "show": show(1, false) }));
    tab.send(&json!({ "pick": { "id": 2, "x": 0.5, "y": 0.5, "clusters": true } }));
    let hit = tab.words("picked")["hit"].clone();
    assert_eq!(hit["transport"], Value::Null);
    let clusters = &hit["clusters"];
    let cut = clusters["cut"].as_array().unwrap();
    assert_eq!(clusters["of"].as_u64().unwrap() as usize, cut.len());
    let shares: Vec<f64> = cut.iter().map(|c| c["share"].as_f64().unwrap()).collect();
    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-4, "{clusters}");
    assert!(shares.is_sorted_by(|a, b| a >= b));
    let held: u64 = cut.iter().map(|c| c["lights"].as_u64().unwrap()).sum();
    let all = clusters["lights"].as_u64().unwrap();
    assert!(
        held <= all && (cut.len() as u64) < all,
        "{} of {held} of {all}",
        cut.len()
    );
    let is_indirect = |c: &&Value| c["indirect"] == true;
    let (virtuals, lamps): (Vec<&Value>, Vec<&Value>) = cut.iter().partition(is_indirect);
    assert!(!virtuals.is_empty() && !lamps.is_empty(), "{clusters}");
    // Whoever shines nothing has no cut.
    let mut dark = show(3, false);
    dark["lights"] = lights(0.0);
    tab.send(&json!({ "show": dark }));
    tab.send(&json!({ "pick": { "id": 4, "x": 0.5, "y": 0.5, "clusters": true } }));
    let hit = tab.words("picked")["hit"].clone();
    assert_eq!(hit["clusters"]["of"], 0, "{hit}");
}

/// Truth: the asset that stands in the file, whole or not.
#[test]
fn an_asset_that_is_replaced_is_shown_anew() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cornell.relight");
    std::fs::copy("../play/tests/cornell.relight", &file).unwrap();
    let asset = file.clone();
    let opened = move || {
        let player = relight_play::Player::open(&asset).map_err(|error| error.to_string())?;
        Ok(Exhibit {
            asset: "anew".into(),
            ..exhibit(player)
        })
    };
    let served = Served::watching(exhibit(player()), file.clone(), Box::new(opened));
    let mut tab = Tab::open(&served.url);
    tab.send(&json!({ "show": show(1, false) }));
    let (_, before) = tab.picture_at("final");
    let replace = |bytes: &[u8]| {
        let new = folder.path().join("new");
        std::fs::write(&new, bytes).unwrap();
        std::fs::rename(&new, &file).unwrap();
    };
    replace(b"no asset");
    let what = tab.refused();
    assert!(
        what.contains("was replaced") && what.contains("goes on"),
        "{what}"
    );
    tab.send(&json!({ "show": show(2, false) }));
    assert_eq!(tab.picture_at("final").1, before);
    replace(&std::fs::read("../play/tests/cornell.relight").unwrap());
    assert_eq!(tab.words("hello")["asset"], "anew");
    // It is looked at from scratch.
    tab.send(&json!({ "show": show(3, false) }));
    assert_eq!(tab.picture_at("final").1, before);
    assert_eq!(Tab::connect(&served.url).hello().unwrap()["asset"], "anew");
}

/// Truth: the same lights with the map in the text itself, as a command line takes them.
#[test]
fn maps_in_the_text_have_short_names_here() {
    let map = "data:image/vnd.radiance;base64,Iz9SQURJQU5DRQpGT1JNQVQ9MzItYml0X3JsZV9yZ2JlCgotWSAxICtYIDIKgEAggSBAgII=";
    let text = json!({ "relight_sequence": 1, "lights": [
        { "name": "sky", "type": "environment", "file": map },
        { "name": "dusk", "type": "environment", "scale": 0.5, "file": { "keys": [[0, map], [4, map]], "interpolation": "step" } } ] });
    let sequence = parse_sequence(&text.to_string(), Path::new(""), "lights").unwrap();
    let shown = || Exhibit {
        sequence: sequence.clone(),
        ..exhibit(player())
    };
    let served = Served::of(shown());
    let mut tab = Tab::connect(&served.url);
    let hello = tab.hello().unwrap();
    let told = &hello["sequence"];
    assert_eq!(told["lights"][0]["file"], "map of sky");
    assert_eq!(
        told["lights"][1]["file"]["keys"],
        json!([[0.0, "map of dusk"], [4.0, "map 2 of dusk"]])
    );
    assert_eq!(
        hello["embedded"],
        json!({ "map of sky": map, "map of dusk": map, "map 2 of dusk": map })
    );
    let mut picture = |lights: &Value| {
        let mut wish = show(1, false);
        wish["lights"] = lights.clone();
        tab.send(&json!({ "show": wish }));
        tab.picture_at("final").1
    };
    let by_name = picture(told);
    assert_eq!(by_name, picture(&text));
    assert_ne!(by_name, picture(&lights(1.0)));
}

/// Truth: what a variant shows, edited by hand.
#[test]
fn a_variant_is_shown_by_name() {
    use relight_play::scene::scene::Variant;
    use relight_play::{
        PreparedScene,
        scene::traced::{Shading, TracedScene},
    };
    let mut scene = player().scene().as_ref().clone();
    // Everything that is of one material is shown in another's colours.
    let green = (scene
        .materials
        .iter()
        .position(|material| material.base_color.y > 2.0 * material.base_color.x))
    .unwrap();
    let white = (scene
        .materials
        .iter()
        .position(|material| material.base_color.x == material.base_color.y))
    .unwrap();
    scene.variants = vec![Variant {
        name: "dusk".into(),
        materials: vec![[white as u32, green as u32]],
    }];
    let edit = json!({ "material": white, "base_color": scene.materials[green].base_color.to_array()[..3] });
    let scene = TracedScene::new(scene.into(), Shading::Full).unwrap();
    let varied = relight_play::Player::new(PreparedScene::new(scene, None, None));
    let served = Served::of(exhibit(varied));
    let mut tab = Tab::connect(&served.url);
    assert_eq!(
        tab.hello().unwrap()["variants"],
        json!([{ "name": "dusk", "materials": [[white, green]] }])
    );
    let mut picture = |materials: Value| {
        let mut wish = show(1, false);
        wish["materials"] = materials;
        tab.send(&json!({ "show": wish }));
        tab.picture_at("final").1
    };
    let plain = picture(json!({ "relight_materials": 1, "edits": [] }));
    let dusk = picture(json!({ "relight_materials": 1, "edits": [], "variant": "dusk" }));
    assert_ne!(dusk, plain);
    assert_eq!(dusk, picture(json!({ "relight_materials": 1, "edits": [edit] })));
    assert_eq!(
        picture(json!({ "relight_materials": 1, "edits": [] })),
        plain,
        "nothing of it stays"
    );
    let mut wish = show(2, false);
    wish["materials"] = json!({ "relight_materials": 1, "edits": [], "variant": "dawn" });
    tab.send(&json!({ "show": wish }));
    let what = tab.refused();
    assert!(what.contains("dawn") && what.contains("dusk"), "{what}");
}

#[test]
fn ten_thousand_messages_a_second_hold_up_nobody() {
    let served = Served::new();
    let (mut busy, mut other) = (Tab::open(&served.url), Tab::open(&served.url));
    let text = json!({ "show": show(1, true) }).to_string();
    let sending = std::thread::spawn(move || {
        for _ in 0..10_000 {
            busy.send_text(&text);
        }
        busy.send(&json!({ "show": show(2, false) }));
        busy.picture_at("final").0["id"].clone()
    });
    other.send(&json!({ "show": show(7, false) }));
    assert_eq!(other.picture_at("final").0["id"], 7);
    assert_eq!(sending.join().unwrap(), 2);
}

/// Truth: 32 k × 16 k pixels are more than are taken, which the head of the file says before any of them is read.
#[test]
fn a_map_that_is_too_large_is_refused_in_words() {
    let served = Served::new();
    let head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16384 +X 32768\n".to_vec();
    let (status, text) = post(&format!("{}maps/huge.hdr", served.url), head);
    let text = String::from_utf8_lossy(&text).into_owned();
    assert_eq!(status, 422, "{text}");
    assert!(text.contains("536870912") && text.contains("limit"), "{text}");
}

#[test]
fn a_port_in_use_is_said_in_words() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let error = View::bind(address, exhibit(player())).err().unwrap();
    assert!(matches!(error, ViewError::InUse(_)));
    let text = error.to_string();
    assert!(
        text.contains(&address.port().to_string()) && text.contains("--port"),
        "{text}"
    );
}

#[test]
fn an_asset_without_points_is_path_traced() {
    use relight_play::{
        PreparedScene,
        scene::traced::{Shading, TracedScene},
    };
    let scene = player().scene().clone();
    let scene = TracedScene::new(scene, Shading::Full).unwrap();
    let bare = relight_play::Player::new(PreparedScene::new(scene, None, None));
    let served = Served::of(Exhibit {
        sequence: bare.scene().sequence.clone(),
        ..exhibit(bare)
    });
    let mut tab = Tab::connect(&served.url);
    assert_eq!(tab.hello().unwrap()["points"], 0);
    tab.send(&json!({ "show": show(1, false) }));
    let (head, _) = tab.picture_at("final");
    assert!(
        head["choice"].as_str().unwrap().contains("path tracing"),
        "{head}"
    );
}

#[test]
fn who_looks_is_told_when_the_server_ends() {
    let mut served = Served::new();
    let mut tab = Tab::open(&served.url);
    served.end();
    assert!(tab.closes());
}

//! The page, held by the program: no file of the machine is read for it.

/// Name, media type and content of each file.
const FILES: [(&str, &str, &str); 19] = [
    ("", "text/html; charset=utf-8", include_str!("../page/index.html")),
    (
        "style.css",
        "text/css; charset=utf-8",
        include_str!("../page/style.css"),
    ),
    ("icon.svg", "image/svg+xml", include_str!("../page/icon.svg")),
    ("main.js", JAVASCRIPT, include_str!("../page/main.js")),
    ("link.js", JAVASCRIPT, include_str!("../page/link.js")),
    ("math.js", JAVASCRIPT, include_str!("../page/math.js")),
    ("state.js", JAVASCRIPT, include_str!("../page/state.js")),
    ("clusters.js", JAVASCRIPT, include_str!("../page/clusters.js")),
    ("lights.js", JAVASCRIPT, include_str!("../page/lights.js")),
    ("overlay.js", JAVASCRIPT, include_str!("../page/overlay.js")),
    ("panel.js", JAVASCRIPT, include_str!("../page/panel.js")),
    ("stage.js", JAVASCRIPT, include_str!("../page/stage.js")),
    ("beside.js", JAVASCRIPT, include_str!("../page/beside.js")),
    ("make.js", JAVASCRIPT, include_str!("../page/make.js")),
    ("material.js", JAVASCRIPT, include_str!("../page/material.js")),
    ("picture.js", JAVASCRIPT, include_str!("../page/picture.js")),
    ("sun.js", JAVASCRIPT, include_str!("../page/sun.js")),
    ("transport.js", JAVASCRIPT, include_str!("../page/transport.js")),
    ("waveform.js", JAVASCRIPT, include_str!("../page/waveform.js")),
];
const JAVASCRIPT: &str = "text/javascript; charset=utf-8";

/// Media type and content of a file of the page.
pub fn file(name: &str) -> Option<(&'static str, &'static str)> {
    let found = FILES.iter().find(|(known, ..)| *known == name);
    found.map(|(_, media, content)| (*media, *content))
}

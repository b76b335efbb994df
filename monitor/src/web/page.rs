//! The dashboard's page, built into the program.

use axum::{
    Router,
    http::{StatusCode, header},
    response::IntoResponse,
    routing::get,
};

macro_rules! files {
    ($($name:literal)*) => {
        const FILES: &[(&str, &str)] = &[$(($name, include_str!(concat!("page/", $name)))),*];
    };
}

files! {
    "index.html"
    "alarm.js"
    "arm.js"
    "axis.js"
    "canvas.js"
    "charts.js"
    "export.js"
    "gestures.js"
    "histogram.js"
    "icon.svg"
    "knobs.js"
    "live.js"
    "main.js"
    "page.css"
    "palette.js"
    "roles.js"
    "ruler.js"
    "store.js"
    "strip.js"
    "token.js"
    "view.js"
}

/// A route for each of the page's files.
pub(super) fn routes<S: Clone + Send + Sync + 'static>() -> Router<S> {
    let mut router = Router::new()
        // Browsers request it on their own and log an error if it is missing.
        .route("/favicon.ico", get(|| async { StatusCode::NO_CONTENT }));
    for (name, text) in FILES {
        let respond =
            move || async move { ([(header::CONTENT_TYPE, kind(name))], *text).into_response() };
        let path = if *name == "index.html" { "/".to_owned() } else { format!("/{name}") };
        router = router.route(&path, get(respond));
    }
    router
}

fn kind(name: &str) -> &'static str {
    match name.rsplit_once('.') {
        Some((_, "html")) => "text/html; charset=utf-8",
        Some((_, "css")) => "text/css; charset=utf-8",
        Some((_, "js")) => "text/javascript; charset=utf-8",
        Some((_, "svg")) => "image/svg+xml",
        _ => "text/plain; charset=utf-8",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_page_is_built_in() {
        let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/src/web/page");
        for file in std::fs::read_dir(directory).unwrap() {
            let name = file.unwrap().file_name().into_string().unwrap();
            assert!(FILES.iter().any(|(known, _)| *known == name), "{name} is not in FILES");
            assert!(!kind(&name).starts_with("text/plain"), "{name} has no content type");
        }
    }
}

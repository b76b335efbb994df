//! From SVG to PNG.

use std::sync::{Arc, OnceLock};

use resvg::{
    tiny_skia::{Color, Pixmap, Transform},
    usvg::{Options, Tree, fontdb::Database},
};

use super::FigureError;

/// PNG pixels for each pixel of the SVG: sharp on dense screens and in print.
const SCALE: f32 = 2.0;

/// The picture of an SVG document on white, with the font the program carries.
///
/// # Errors
///
/// If the document is not SVG or has no area.
pub fn png(svg: &str) -> Result<Vec<u8>, FigureError> {
    let options = Options { fontdb: fonts(), ..Options::default() };
    let tree = Tree::from_str(svg, &options)?;
    let size = tree.size().to_int_size().scale_by(SCALE).ok_or(FigureError::NoArea)?;
    let mut picture = Pixmap::new(size.width(), size.height()).ok_or(FigureError::NoArea)?;
    picture.fill(Color::WHITE);
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut picture.as_mut());
    picture.encode_png().map_err(|error| FigureError::Png(error.into()))
}

/// The one font, standing in for every family a document may name.
fn fonts() -> Arc<Database> {
    static FONTS: OnceLock<Arc<Database>> = OnceLock::new();
    let load = || {
        let mut fonts = Database::new();
        fonts.load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
        let family = fonts
            .faces()
            .next()
            .and_then(|face| face.families.first())
            .map_or_else(String::new, |(family, _)| family.clone());
        fonts.set_sans_serif_family(&family);
        fonts.set_serif_family(&family);
        Arc::new(fonts)
    };
    FONTS.get_or_init(load).clone()
}

//! A page of PDF as a backend of the drawing library. Lines, areas and circles are what they are in PDF; letters are those of Helvetica
//! and Symbol, which every reader of the format has (ISO 32000-1, 9.6.2.2), so a figure's words stay text.

use super::paper::PER_POINT;
use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
    FontTransform,
};
use std::convert::Infallible;

/// What a stroke comes to: nothing can go wrong.
type Drawn = Result<(), DrawingErrorKind<Infallible>>;

/// Advance widths of Helvetica from the blank to the tilde, in thousandths of the letters' size (Adobe's metrics of its core fonts).
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556,
    556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278,
    500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469,
    556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500,
    278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];

/// A letter: its font, its code there, its width.
fn letter(of: char) -> (Name<'static>, u8, u16) {
    let (helvetica, symbol) = (Name(b"H"), Name(b"S"));
    match of {
        ' '..='~' => (helvetica, of as u8, WIDTHS[of as usize - 32]),
        '\u{b5}' => (helvetica, 0xb5, 556),
        '\u{b1}' => (helvetica, 0xb1, 584),
        '\u{b0}' => (helvetica, 0xb0, 400),
        '\u{3a8}' => (symbol, 0x59, 795),
        _ => (helvetica, b'?', 556),
    }
}

fn width_of(text: &str, size: f64) -> f64 {
    text.chars().map(|c| f64::from(letter(c).2)).sum::<f64>() * size * 1e-3
}

/// Draws one page into `to`; it is there once this is dropped or presented.
pub struct PdfBackend<'a> {
    to: &'a mut Vec<u8>,
    size: (u32, u32),
    content: Content,
}

impl<'a> PdfBackend<'a> {
    /// A page of that size, in tenths of a point.
    pub fn new(to: &'a mut Vec<u8>, size: (u32, u32)) -> Self {
        PdfBackend { to, size, content: Content::new() }
    }

    /// A place on the page in points from its lower left corner, where PDF has its origin.
    fn at(&self, (x, y): BackendCoord) -> (f32, f32) {
        let scale = 1.0 / PER_POINT as f32;
        (x as f32 * scale, (self.size.1 as i32 - y) as f32 * scale)
    }

    fn stroke_as(&mut self, style: &impl BackendStyle) {
        let [r, g, b] = on_white(style.color());
        self.content.set_stroke_rgb(r, g, b);
        self.content.set_line_width(style.stroke_width() as f32 / PER_POINT as f32);
    }

    fn fill_as(&mut self, style: &impl BackendStyle) {
        let [r, g, b] = on_white(style.color());
        self.content.set_fill_rgb(r, g, b);
    }

    fn path(&mut self, places: impl IntoIterator<Item = BackendCoord>) {
        for (n, place) in places.into_iter().enumerate() {
            let (x, y) = self.at(place);
            if n == 0 {
                self.content.move_to(x, y);
            } else {
                self.content.line_to(x, y);
            }
        }
    }
}

/// What is lighter than its colour is mixed with the paper's white.
fn on_white(BackendColor { alpha, rgb: (r, g, b) }: BackendColor) -> [f32; 3] {
    [r, g, b].map(|c| (1.0 - alpha + alpha * f64::from(c) / 255.0) as f32)
}

impl DrawingBackend for PdfBackend<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        let [catalogue, pages, page, content, helvetica, symbol] = [1, 2, 3, 4, 5, 6].map(Ref::new);
        let mut pdf = Pdf::new();
        pdf.catalog(catalogue).pages(pages);
        pdf.pages(pages).kids([page]).count(1);
        let (width, _) = self.at((self.size.0 as i32, 0));
        let (_, height) = self.at((0, 0));
        let mut sheet = pdf.page(page);
        sheet.media_box(Rect::new(0.0, 0.0, width, height)).parent(pages).contents(content);
        sheet.resources().fonts().pair(Name(b"H"), helvetica).pair(Name(b"S"), symbol);
        sheet.finish();
        pdf.type1_font(helvetica).base_font(Name(b"Helvetica")).encoding_predefined(Name(b"WinAnsiEncoding"));
        pdf.type1_font(symbol).base_font(Name(b"Symbol"));
        pdf.stream(content, &std::mem::replace(&mut self.content, Content::new()).finish());
        *self.to = pdf.finish();
        Ok(())
    }

    fn draw_pixel(&mut self, place: BackendCoord, colour: BackendColor) -> Drawn {
        self.draw_rect(place, (place.0 + 1, place.1 + 1), &colour, true)
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> Drawn {
        self.draw_path([from, to], style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let corners = [from, (to.0, from.1), to, (from.0, to.1), from];
        if fill { self.fill_polygon(corners, style) } else { self.draw_path(corners, style) }
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        if style.color().alpha > 0.0 {
            self.stroke_as(style);
            self.path(path);
            self.content.stroke();
        }
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        centre: BackendCoord,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let (x, y) = self.at(centre);
        let r = radius as f32 / PER_POINT as f32;
        // Four cubic arcs: 0.5523 of the radius is the usual distance of their control points.
        let k = 0.5523 * r;
        if fill {
            self.fill_as(style)
        } else {
            self.stroke_as(style)
        }
        self.content.move_to(x + r, y);
        self.content.cubic_to(x + r, y + k, x + k, y + r, x, y + r);
        self.content.cubic_to(x - k, y + r, x - r, y + k, x - r, y);
        self.content.cubic_to(x - r, y - k, x - k, y - r, x, y - r);
        self.content.cubic_to(x + k, y - r, x + r, y - k, x + r, y);
        if fill {
            self.content.fill_nonzero()
        } else {
            self.content.stroke()
        };
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        corners: I,
        style: &S,
    ) -> Drawn {
        if style.color().alpha > 0.0 {
            self.fill_as(style);
            self.path(corners);
            self.content.close_path();
            self.content.fill_nonzero();
        }
        Ok(())
    }

    fn draw_text<T: BackendTextStyle>(&mut self, text: &str, style: &T, place: BackendCoord) -> Drawn {
        let [r, g, b] = on_white(style.color());
        let size = style.size() as f32 / PER_POINT as f32;
        let width = width_of(text, f64::from(size)) as f32;
        let anchor = style.anchor();
        let along = match anchor.h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * width,
            HPos::Right => -width,
        };
        // From the place down to the letters' base line: capitals are 0.72 of the size high.
        let down = match anchor.v_pos {
            VPos::Top => 0.76 * size,
            VPos::Center => 0.36 * size,
            VPos::Bottom => -0.2 * size,
        };
        let (cos, sin) = match style.transform() {
            FontTransform::None => (1.0, 0.0),
            FontTransform::Rotate90 => (0.0, -1.0),
            FontTransform::Rotate180 => (-1.0, 0.0),
            FontTransform::Rotate270 => (0.0, 1.0),
        };
        let (x, y) = self.at(place);
        let (x, y) = (x + cos * along + sin * down, y + sin * along - cos * down);
        self.content.begin_text();
        self.content.set_fill_rgb(r, g, b);
        self.content.set_text_matrix([cos, sin, -sin, cos, x, y]);
        for c in text.chars() {
            let (font, code, _) = letter(c);
            self.content.set_font(font, size);
            self.content.show(Str(&[code]));
        }
        self.content.end_text();
        Ok(())
    }

    fn estimate_text_size<T: BackendTextStyle>(
        &self,
        text: &str,
        style: &T,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        Ok((width_of(text, style.size()).ceil() as u32, style.size().ceil() as u32))
    }
}

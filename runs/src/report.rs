//! The report of a run: one self-contained HTML page. Nothing comes from elsewhere, and without JavaScript it
//! says the same. An error of a page is a folder that holds no run; one of a part of a page comes from the
//! drawing library, unless it states another.
//!
//! | module | part of a page |
//! |---|---|
//! | `page`, [`events`], [`traces`], [`fidelity`], `explore` | a run |
//! | [`diagnosis`] | a verdict; law figure: `diagnosis/law` and `plots/verdict` |
//! | [`comparison`], [`groups`] | two runs, more |
//! | [`plots`], [`published`], [`mod@html`], `levels` | figures, published values, text, levels |

pub mod comparison;
pub mod diagnosis;
pub mod events;
mod explore;
pub mod fidelity;
pub mod groups;
pub mod html;
pub mod levels;
mod page;
pub mod plots;
pub mod published;
pub mod traces;

use crate::job::Summary;
use crate::run_data::read;
use std::path::Path;

pub use explore::{EXPLORE, FIGURES, UPLOT, UPLOT_STYLE};
pub use html::{escape, scoped_style};

/// The report of a run as HTML, with published values on its axes; and what is damaged in the folder.
/// `ended`: a summary that is not in the folder yet.
pub fn html(
    folder: &Path,
    overlay: &[published::Published],
    ended: Option<&Summary>,
) -> miette::Result<(String, Vec<String>)> {
    let mut run = read(folder)?;
    run.summary = ended.cloned().or(run.summary);
    Ok((page::page(&run, &traces::of(folder)?, overlay)?, run.damage))
}

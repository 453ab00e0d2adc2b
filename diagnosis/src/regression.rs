//! The fit of one hypothesis to a table, and its marginal likelihood.
//!
//! [`member`] and [`layout`] say which causes are fitted and where their coordinates are; [`fit`] has the
//! regression problem and [`starts`] its global search. [`bases`] and [`departure`] let a hypothesis depart from
//! its form, and [`evidence`] integrates over that; [`discrepancy`] is the departure of the open set.
//! [`gaussian`], [`kernel`] and [`least_squares`] are the algebra under them; [`recalibration`] is what the
//! baseline's nuisances imitate of a change.

pub mod bases;
pub mod departure;
pub mod discrepancy;
pub mod evidence;
pub mod fit;
pub mod gaussian;
pub mod kernel;
pub mod layout;
pub mod least_squares;
pub mod member;
pub mod recalibration;
pub mod starts;

pub use bases::{Basis, Bends, Kernels};
pub(crate) use bases::{beside_each_other, goes_with_place};
pub use departure::{Change, Freedom};
pub(crate) use departure::{product, weighted, without_member};
pub use discrepancy::{Discrepancy, lengths};
pub(crate) use discrepancy::{Linear, scale};
pub(crate) use evidence::equations;
pub use evidence::{Posterior, averaged_over_form, laplace, middle_freedom};
pub use fit::Problem;
pub(crate) use gaussian::rows_times;
pub use gaussian::{Covariance, HALF_LN_2PI, Scaled, log_sum_exp};
pub(crate) use kernel::{COUNT, scaled};
pub use kernel::{Coordinates, Kernel, Lengths, form_lengths};
pub use layout::{Layout, NUISANCES};
pub use least_squares::{Fit, bounded_step, carry, minimise};
pub use member::Member;
pub use recalibration::Recalibration;
pub(crate) use starts::{Hunt, REFINED_ROWS};
pub use starts::{Sought, nuisance_starts, seek, tempered};

//! A rectangular block, for closed forms.

use muprime_models::ridge::{Material, Mesh, RidgeError};

/// With equal elements, its lower left corner at the origin.
pub fn block(
    [width_m, height_m]: [f64; 2],
    [nx, ny]: [usize; 2],
    material: Material,
    periodic: bool,
) -> Result<Mesh, RidgeError> {
    Mesh::from_nodes(nx, vec![material; ny], periodic, |i, j| {
        (width_m * i as f64 / nx as f64, height_m * j as f64 / ny as f64)
    })
}

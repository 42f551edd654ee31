//! The bilateral filter of incident light: 5 × 5 pixels, weights max(0, n·n₀)³² / (1 + 10 ‖x − x₀‖) (section 3,
//! "Removing artifacts").
//!
//! **Deviation:** the distance is relative to the scene, in fiftieths of the diagonal of what is seen; printed, it depends
//! on the unit of length.

use super::view::View;

/// Pixels to each side.
const REACH: i64 = 2;
/// Of the cosine between normals; by five squarings.
const SQUARINGS: u32 = 5;
/// Of the distance.
const SLOPE: f32 = 10.0;
/// Unit of the distance as a share of the diagonal.
const UNIT: f32 = 0.02;

/// Puts the filtered light of point `point` into `out`; both have as many numbers a point.
pub(super) fn filtered(view: &View, light: &[f32], point: usize, out: &mut [f32]) {
    let stride = out.len();
    out.fill(0.0);
    let [x, y, sample] = view.place[point];
    let center = &view.points[point];
    let per_metre = SLOPE / (UNIT * view.diagonal);
    let mut sum = 0.0;
    for dy in -REACH..=REACH {
        for dx in -REACH..=REACH {
            let (px, py) = (i64::from(x) + dx, i64::from(y) + dy);
            if px < 0 || py < 0 || px >= view.size.width as i64 || py >= view.size.height as i64 {
                continue;
            }
            let Some(other) = view.at((px as usize, py as usize), sample) else {
                continue;
            };
            let neighbour = &view.points[other];
            let mut weight = center
                .shading
                .shading_normal
                .dot(neighbour.shading.shading_normal)
                .max(0.0);
            for _ in 0..SQUARINGS {
                weight *= weight;
            }
            weight /= 1.0 + per_metre * center.hit.position.distance(neighbour.hit.position);
            sum += weight;
            let from = &light[other * stride..][..stride];
            out.iter_mut()
                .zip(from)
                .for_each(|(out, from)| *out += weight * from);
        }
    }
    // Its own weight is 1 but for rounding.
    out.iter_mut().for_each(|out| *out /= sum);
}

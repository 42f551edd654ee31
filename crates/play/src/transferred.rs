//! What transfer made of the last light: as long as neither a lamp nor a material moves, it is the same wherever a camera goes.

use crate::edition::Edition;
use crate::transfer::{OverLobes, Transfer, TransferStats};
use glam::Vec3;
use relight_transport::pyramid::VectorIrradiance;
use std::sync::{Arc, Mutex, PoisonError};

/// Indirect light at the finest points, of the last frame.
#[derive(Debug, Default)]
pub(crate) struct Transferred(Mutex<Option<Last>>);

#[derive(Clone, Debug)]
struct Last {
    /// Of the materials.
    edition: Edition,
    coarse: bool,
    direct: Arc<[Vec3]>,
    over_lobes: Option<Arc<OverLobes>>,
    indirect: Arc<[VectorIrradiance]>,
    stats: TransferStats,
}

impl Transferred {
    /// [`Transfer::indirect_with_lobes`] or [`Transfer::coarsely_from_direct`], made anew only if anything is otherwise than it was the last
    /// time; what was made with care is as good for a coarse frame.
    pub fn indirect_from_direct(
        &self,
        transfer: &Transfer,
        edition: Edition,
        direct: &[Vec3],
        over_lobes: Option<&OverLobes>,
        coarse: bool,
    ) -> (Arc<[VectorIrradiance]>, TransferStats) {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let same = |last: &Last| {
            last.edition == edition
                && (coarse || !last.coarse)
                && *last.direct == *direct
                && last.over_lobes.as_deref() == over_lobes
        };
        if let Some(last) = last.filter(same) {
            return (last.indirect, last.stats.of_nothing_new());
        }
        let (indirect, stats) = match coarse {
            true => transfer.coarsely_from_direct(direct, over_lobes),
            false => transfer.indirect_with_lobes(direct, over_lobes),
        };
        let indirect: Arc<[VectorIrradiance]> = indirect.into();
        let made = Last {
            edition,
            coarse,
            direct: direct.into(),
            over_lobes: over_lobes.cloned().map(Arc::new),
            indirect: indirect.clone(),
            stats,
        };
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(made);
        (indirect, stats)
    }

    /// Forgets it.
    pub fn forget(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

//! How long rays take, measured on the bake's own rays.
//!
//! Method: batches and packets are timed each. Of single rays one call in 61 of every thread is timed, less what the
//! timer itself costs (calibrated at the start), and the mean is scaled up to all single rays. Timing every one would take
//! longer than many rays do; the sample is thousands of rays even in a small bake, so its mean is good to a few per cent.
//! Calls during which the system gave the core to another process are left out, or one of them would count 61 times.

use glam::Vec3;
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// One call in so many is timed: a prime, so that no place in the loops that cast rays is timed more often.
const EVERY: u32 = 61;
/// A call that takes longer was interrupted: rays take about a microsecond, through a million triangles and
/// their textures some ten; a process that has lost its core waits for a millisecond and more.
const INTERRUPTED_NANOS: u64 = 200_000;
/// Timer readings of the calibration.
const CALIBRATION: usize = 4096;

thread_local! {
    static CALLS: Cell<u32> = const { Cell::new(0) };
}

/// Surfaces that measure how long rays through them take.
pub struct TimedSurfaces<'a> {
    inner: &'a dyn Surfaces,
    timer_nanos: u64,
    sampled: AtomicU64,
    nanos: AtomicU64,
    /// All packets and batches, timed each: many rays hide the timer.
    together_nanos: AtomicU64,
    /// Rays of the batches.
    in_batches: AtomicU64,
}

impl<'a> TimedSurfaces<'a> {
    /// Wraps surfaces.
    pub fn new(inner: &'a dyn Surfaces) -> Self {
        let mut costs: Vec<u64> = (0..CALIBRATION)
            .map(|_| {
                let start = Instant::now();
                start.elapsed().as_nanos() as u64
            })
            .collect();
        costs.sort_unstable();
        TimedSurfaces {
            inner,
            timer_nanos: costs[CALIBRATION / 2],
            sampled: AtomicU64::new(0),
            nanos: AtomicU64::new(0),
            together_nanos: AtomicU64::new(0),
            in_batches: AtomicU64::new(0),
        }
    }

    /// Thread-seconds that the rays of all packets took, and `rays` others: those in batches, and single ones at the mean of
    /// the sampled ones.
    pub fn thread_seconds(&self, rays: u64) -> f64 {
        let single = rays.saturating_sub(self.in_batches.load(Ordering::Relaxed)) as f64;
        let sampled = self.sampled.load(Ordering::Relaxed).max(1) as f64;
        let nanos = self.nanos.load(Ordering::Relaxed) as f64 * (single / sampled);
        (nanos + self.together_nanos.load(Ordering::Relaxed) as f64) * 1e-9
    }

    fn timed_together(&self, call: impl FnOnce()) {
        let start = Instant::now();
        call();
        self.together_nanos
            .fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
    }

    #[inline]
    fn timed<T>(&self, call: impl FnOnce() -> T) -> T {
        let turn = CALLS.with(|calls| {
            let turn = calls.get().wrapping_add(1);
            calls.set(turn);
            turn
        });
        if !turn.is_multiple_of(EVERY) {
            return call();
        }
        let start = Instant::now();
        let result = call();
        let nanos = start.elapsed().as_nanos() as u64;
        if nanos < INTERRUPTED_NANOS {
            self.nanos
                .fetch_add(nanos.saturating_sub(self.timer_nanos), Ordering::Relaxed);
            self.sampled.fetch_add(1, Ordering::Relaxed);
        }
        result
    }
}

impl Surfaces for TimedSurfaces<'_> {
    fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.inner.bounds()
    }
    fn closest_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        self.timed(|| self.inner.closest_hit(ray))
    }
    fn closest_hits(&self, rays: &[Ray], visit: &mut dyn FnMut(usize, SurfaceHit)) {
        self.timed_together(|| self.inner.closest_hits(rays, visit));
        self.in_batches.fetch_add(rays.len() as u64, Ordering::Relaxed);
    }
    fn occluded(&self, ray: &Ray) -> bool {
        self.timed(|| self.inner.occluded(ray))
    }
    fn occluded_packet(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.timed_together(|| self.inner.occluded_packet(rays, occluded));
    }
    fn tint(&self, ray: &Ray, t: f32) -> Vec3 {
        self.inner.tint(ray, t)
    }
    fn albedo(&self, hit: &SurfaceHit) -> Vec3 {
        self.inner.albedo(hit)
    }
}

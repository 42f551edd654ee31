//! Disks of surface, and how much of their light arrives at a place.

use crate::spread::sunflower;
use crate::transfer::Transfer;
use glam::Vec3;

/// A piece of surface.
pub(super) struct Disk {
    pub middle: Vec3,
    pub normal: Vec3,
    /// m.
    pub radius: f32,
}

impl Disk {
    /// So many places of it, the middle if it is one, and the radius of the surface that each stands for.
    pub fn places(&self, count: usize) -> impl Iterator<Item = (Vec3, f32)> + use<> {
        let Disk { middle, radius, .. } = *self;
        let (a, b) = self.normal.any_orthonormal_pair();
        let each = radius / (count as f32).sqrt();
        (0..count).map(move |k| match count {
            1 => (middle, each),
            _ => {
                let away = radius * sunflower(k, count, 0);
                (middle + a * away.x + b * away.y, each)
            }
        })
    }
}

/// Where light is received.
pub(super) struct Receiver {
    pub place: Vec3,
    /// Unit.
    pub normal: Vec3,
}

impl Receiver {
    /// One of a transfer's receivers, numbered over all levels.
    pub fn at(transfer: &Transfer, receiver: usize) -> Receiver {
        Receiver {
            place: transfer.position_of(receiver),
            normal: transfer.normal_of(receiver),
        }
    }

    /// Irradiance by radiosity 1 of a small disk; zero where either faces away.
    pub fn form_factor(&self, place: Vec3, normal: Vec3, radius: f32) -> f32 {
        let way = place - self.place;
        let (here, there) = (self.normal.dot(way), -normal.dot(way));
        if here <= 0.0 || there <= 0.0 {
            return 0.0;
        }
        let (square, area) = (way.length_squared(), radius * radius);
        // No more than of a disk that fills the view; 0 where scenes are so small or large that squares are no numbers.
        ((here * there / square) * (area / square.max(area))).max(0.0)
    }
}

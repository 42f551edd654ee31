//! The number of each primitive's material.
//!
//! Where variants of materials may be chosen, a material stands for itself and for what they put in its place: primitives that share a
//! material but not its replacements get copies of it.

use super::primitives::Primitive;
use crate::material::Material;
use crate::scene::Variant;
use std::collections::HashMap;

/// A primitive's material, and what variants put in its place.
type Varied = (Option<usize>, Vec<(usize, usize)>);

/// The material's number of each primitive.
pub(super) struct MaterialNumbers {
    default: u32,
    /// Of primitives whose material has replacements.
    numbers: HashMap<Varied, u32>,
    /// Materials with replacements, and variants with theirs.
    varied: Vec<(u32, Vec<(usize, usize)>)>,
    /// What the materials after the default one are copies of.
    copies: Vec<u32>,
}

impl MaterialNumbers {
    /// Numbers those that are shown, in their order; `default`: that of primitives without a material, after which copies follow.
    pub fn new<'a>(shown: impl Iterator<Item = &'a Primitive> + Clone, default: u32) -> MaterialNumbers {
        let mut numbers = MaterialNumbers {
            default,
            numbers: HashMap::new(),
            varied: Vec::new(),
            copies: Vec::new(),
        };
        let plain = shown.clone().filter(|primitive| primitive.variants.is_empty());
        let mut taken: Vec<bool> = vec![false; default as usize + 1];
        plain.for_each(|primitive| taken[numbers.own(primitive) as usize] = true);
        for primitive in shown.filter(|primitive| !primitive.variants.is_empty()) {
            let key = (primitive.material, primitive.variants.clone());
            if numbers.numbers.contains_key(&key) {
                continue;
            }
            let own = numbers.own(primitive);
            let mut number = own;
            if std::mem::replace(&mut taken[own as usize], true) {
                numbers.copies.push(own);
                number = default + numbers.copies.len() as u32;
            }
            numbers.varied.push((number, key.1.clone()));
            numbers.numbers.insert(key, number);
        }
        numbers
    }

    /// As the file numbers it.
    fn own(&self, primitive: &Primitive) -> u32 {
        primitive
            .material
            .map_or(self.default, |material| material as u32)
    }

    /// A primitive's.
    pub fn of(&self, primitive: &Primitive) -> u32 {
        let own = self.own(primitive);
        if primitive.variants.is_empty() {
            return own;
        }
        let key = (primitive.material, primitive.variants.clone());
        self.numbers.get(&key).copied().unwrap_or(own)
    }

    /// Materials that variants put in place of others.
    pub fn replacements(&self) -> impl Iterator<Item = usize> {
        self.varied
            .iter()
            .flat_map(|(_, by)| by)
            .map(|(_, material)| *material)
    }

    /// Appends the copies, after the default material, which is there wherever variants or copies need it.
    pub fn append_copies(&self, materials: &mut Vec<Material>) {
        let needs_default = self.varied.iter().any(|(number, _)| *number >= self.default);
        if needs_default && materials.len() as u32 == self.default {
            materials.push(Material::default());
        }
        for &of in &self.copies {
            materials.push(materials[of as usize].clone());
        }
    }

    /// What variants of those names replace; none where nothing that is shown has any.
    pub fn variants(&self, names: &[String]) -> Vec<Variant> {
        if self.varied.is_empty() {
            return Vec::new();
        }
        let named = |name: &String| Variant {
            name: name.clone(),
            materials: Vec::new(),
        };
        let mut variants: Vec<Variant> = names.iter().map(named).collect();
        for (number, by) in &self.varied {
            for &(variant, material) in by.iter().filter(|(_, material)| *material as u32 != *number) {
                variants[variant].materials.push([*number, material as u32]);
            }
        }
        variants
    }
}

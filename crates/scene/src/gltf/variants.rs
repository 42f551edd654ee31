//! KHR_materials_variants: sets of materials of which a file is shown with one.
//!
//! A variant that is asked for is imported alone. Without, all of them are, and a scene may be shown with any.

use super::error::ImportError;
use super::json::{At, Faults};
use super::notes::Notes;
use std::collections::BTreeMap;
use std::path::Path;

const NAME: &str = "KHR_materials_variants";

/// Names listed in a note; of more only the number is told.
const MOST_LISTED: usize = 40;

/// The variants of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Variants {
    chosen: Option<usize>,
    kept: bool,
    names: Vec<String>,
}

impl Variants {
    /// Finds the variant of that name, if one is wanted; if none is, `keep`: whether all are kept.
    ///
    /// # Errors
    /// [`ImportError::UnknownVariant`].
    pub fn parse(
        root: &At,
        file: &Path,
        wanted: Option<&str>,
        keep: bool,
        notes: &mut Notes,
    ) -> Result<Variants, ImportError> {
        let extension = root.extension(NAME);
        let items = extension
            .map(|extension| extension.objects("variants"))
            .unwrap_or_default();
        let name = |item: &At| item.text("name").unwrap_or_default().to_owned();
        let names: Vec<String> = items.iter().map(name).collect();
        let chosen = match wanted {
            None => None,
            Some(wanted) => Some(names.iter().position(|name| name == wanted).ok_or_else(|| {
                ImportError::UnknownVariant {
                    file: file.into(),
                    name: wanted.to_owned(),
                    names: names.clone(),
                }
            })?),
        };
        if !names.is_empty() {
            let shown = match wanted {
                Some(name) => format!("variant {name:?} alone is imported"),
                None if keep => {
                    "materials are imported as they are without a variant, and material edits choose one"
                        .to_owned()
                }
                None => "materials are imported as they are without a variant".to_owned(),
            };
            notes.say(format!("{NAME}: {shown}; there are {}", listed(&names)));
        }
        Ok(Variants {
            chosen,
            kept: keep && chosen.is_none(),
            names,
        })
    }

    /// The material that the chosen variant gives a primitive, if it gives it one.
    pub fn material(&self, primitive: &At, materials: usize) -> Option<usize> {
        let chosen = self.chosen?;
        for mapping in primitive.extension(NAME)?.objects("mappings") {
            let variants = mapping.items("variants");
            if variants
                .iter()
                .any(|item| item.as_index(self.names.len(), "variants") == Some(chosen))
            {
                return mapping.required_index("material", materials, "materials");
            }
        }
        None
    }

    /// Variants that put another material in place of a primitive's, rising, and which; none where variants aren't kept.
    pub fn replacements(&self, primitive: &At, materials: usize, notes: &mut Notes) -> Vec<(usize, usize)> {
        if !self.kept {
            return Vec::new();
        }
        // What is wrong with a variant that nobody asked for does not keep the scene from being shown.
        let faults = Faults::default();
        let lenient = primitive.reporting_to(&faults);
        let Some(extension) = lenient.extension(NAME) else {
            return Vec::new();
        };
        let mut replacements = BTreeMap::new();
        for mapping in extension.objects("mappings") {
            let material = mapping.required_index("material", materials, "materials");
            for item in mapping.items("variants") {
                if let (Some(variant), Some(material)) =
                    (item.as_index(self.names.len(), "variants"), material)
                {
                    replacements.entry(variant).or_insert(material);
                }
            }
        }
        notes.count(
            "primitives with broken mappings of material variants, which are left out",
            u64::from(!faults.take().is_empty()),
        );
        replacements.into_iter().collect()
    }

    /// What they are called.
    pub fn names(&self) -> &[String] {
        &self.names
    }
}

/// Names with commas between them.
pub(super) fn listed(names: &[String]) -> String {
    let mut text: Vec<String> = names
        .iter()
        .take(MOST_LISTED)
        .map(|name| format!("{name:?}"))
        .collect();
    if names.len() > MOST_LISTED {
        text.push(format!("and {} more", names.len() - MOST_LISTED));
    }
    text.join(", ")
}

//! KHR_materials_variants: sets of materials of which a file is shown with one.

use super::error::ImportError;
use super::json::At;
use super::notes::Notes;
use std::path::Path;

const NAME: &str = "KHR_materials_variants";

/// Names listed in a note; of more only the number is told.
const MOST_LISTED: usize = 40;

/// The variant that is shown, and how many there are.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Variants {
    chosen: Option<usize>,
    count: usize,
}

impl Variants {
    /// Finds the variant of that name, if one is wanted.
    ///
    /// # Errors
    /// [`ImportError::UnknownVariant`].
    pub fn parse(
        root: &At,
        file: &Path,
        wanted: Option<&str>,
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
                Some(name) => format!("variant {name:?} is imported"),
                None => "materials are imported as they are without a variant".to_owned(),
            };
            notes.say(format!("{NAME}: {shown}; there are {}", listed(&names)));
        }
        Ok(Variants {
            chosen,
            count: names.len(),
        })
    }

    /// The material that the variant gives a primitive, if it gives it one.
    pub fn material(&self, primitive: &At, materials: usize) -> Option<usize> {
        let chosen = self.chosen?;
        for mapping in primitive.extension(NAME)?.objects("mappings") {
            let variants = mapping.items("variants");
            if variants
                .iter()
                .any(|item| item.as_index(self.count, "variants") == Some(chosen))
            {
                return mapping.required_index("material", materials, "materials");
            }
        }
        None
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

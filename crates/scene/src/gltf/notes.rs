//! What the importer left out or changed, as sentences for the user.

/// Sentences in order of appearance, each once, some with a count.
#[derive(Default)]
pub(super) struct Notes {
    list: Vec<(String, Option<u64>)>,
}

/// Different notes kept: a file with thousands of oddities is described well enough by these.
const MAX_NOTES: usize = 100;

impl Notes {
    /// Adds a sentence, unless it is there already.
    pub fn say(&mut self, sentence: impl Into<String>) {
        let sentence = sentence.into();
        if self.list.len() < MAX_NOTES && !self.list.iter().any(|note| note.0 == sentence) {
            self.list.push((sentence, None));
        }
    }

    /// Adds to the count behind a sentence.
    pub fn count(&mut self, sentence: &str, by: u64) {
        if by == 0 {
            return;
        }
        if let Some(note) = self.list.iter_mut().find(|note| note.0 == sentence) {
            note.1 = Some(note.1.unwrap_or(0).saturating_add(by));
        } else if self.list.len() < MAX_NOTES {
            self.list.push((sentence.to_owned(), Some(by)));
        }
    }

    /// All sentences.
    pub fn into_sentences(self) -> Vec<String> {
        let sentence = |(text, count): (String, Option<u64>)| match count {
            Some(count) => format!("{text}: {count}"),
            None => text,
        };
        self.list.into_iter().map(sentence).collect()
    }
}

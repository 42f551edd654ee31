//! Component types of accessors (glTF 2.0, 3.6.2.2).

use super::json::At;

/// Component types, with the numbers glTF inherits from OpenGL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8 = 5120,
    U8 = 5121,
    I16 = 5122,
    U16 = 5123,
    U32 = 5125,
    F32 = 5126,
}

impl Component {
    /// What an accessor's JSON says.
    pub fn parse(at: &At) -> Option<Component> {
        let code = at.required_uint("componentType")?;
        let found = Component::of(code);
        if found.is_none() {
            at.fault_at(
                "componentType",
                format!("is {code}; glTF knows 5120, 5121, 5122, 5123, 5125 and 5126"),
            );
        }
        found
    }

    /// That of a code of glTF.
    pub fn of(code: u64) -> Option<Component> {
        use Component::*;
        [I8, U8, I16, U16, U32, F32]
            .into_iter()
            .find(|c| *c as u64 == code)
    }

    /// Bytes of one.
    pub fn bytes(self) -> u64 {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }
}

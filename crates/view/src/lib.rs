//! A player in the browser: an asset's lights follow the hand.
//!
//! ```no_run
//! use relight_play::Player;
//! use relight_view::{Exhibit, View};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let player = Player::open("hall.relight")?;
//! let sequence = player.own_lights()?.clone();
//! let exhibit = Exhibit { player, sequence, asset: "hall.relight".into(), lights_file: None, seed: 0 };
//! let view = View::bind("127.0.0.1:8420".parse()?, exhibit)?;
//! println!("{}", view.url());
//! view.serve(|| false)?;
//! # Ok(())
//! # }
//! ```
//!
//! Three rooms, from outside in: [`server`] speaks HTTP and WebSockets, hands out the page that the program holds ([`page`]), and
//! refuses whoever lacks the token; [`desk`] keeps per tab the newest wish and the newest answer, nothing else; [`worker`] is one
//! thread that owns the player and lets each tab's [`painter`] make the next picture: coarse while something moves, at rest what
//! `relight play` writes, and with [`beside`] path tracing next to it. [`wish`] is what tabs may ask for, with its bounds; `docs/view.md` has the protocol.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod beside;
pub mod desk;
pub mod encode;
pub mod exhibit;
pub mod page;
pub mod painter;
pub mod server;
pub mod tone;
pub mod wish;
pub mod worker;

pub use exhibit::{Exhibit, Reopen};
pub use server::{View, ViewError};

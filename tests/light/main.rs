//! Statements about light, through the whole way that it takes: scene → bake → file → player.

mod cuts;
mod furnace;
mod gloss;
mod golden;
mod open_ground;
mod product;
mod stage;
mod sums;
mod tiles;
mod two_lobes;

//! Light of random brightness and colour.

use crate::{
    rng::Stream,
    world::appearance::{change::Lighting, colours::rgb_of_hsv},
};

/// Share of a room's light that does not come from its lamps and stays as it is.
const AMBIENT_SHARE: f32 = 0.2;

impl Lighting {
    /// Return the factors, by channel, of the light in a room.
    ///
    /// # Arguments
    /// * `room` - number of the group of connected rooms.
    pub fn room(&self, room: usize) -> [f32; 3] {
        let lamps = self.source(&format!("room {room}"));
        lamps.map(|channel| AMBIENT_SHARE + (1.0 - AMBIENT_SHARE) * channel)
    }

    /// Return the factors, by channel, of the sunlight.
    pub fn sun(&self) -> [f32; 3] {
        self.source("sun")
    }

    /// Return the factors of a source of light; all are the same if they are synchronized.
    fn source(&self, name: &str) -> [f32; 3] {
        let label = if self.synchronized { "all" } else { name };
        let mut draws = Stream::new(self.seed, &["lighting", label]);
        let mut between = |[a, b]: [f64; 2]| a + (b - a) * draws.uniform();
        let brightness = between(self.brightness);
        let (hue, saturation) = (between(self.hue), between(self.saturation));
        let colour = if self.randomize_color { saturation } else { 0.0 };
        rgb_of_hsv([hue, colour, brightness]).map(|channel| channel as f32)
    }
}

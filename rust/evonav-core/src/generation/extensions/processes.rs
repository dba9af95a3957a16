//! Apply the extensions at a transition, after the paper's evolution.

use crate::{
    Error,
    generation::{
        Occurrence, extensions::transition::Transition, record::EvolutionRecord,
        stage::stage_world::StageWorld,
    },
};

impl Transition<'_> {
    /// Apply all enabled extensions except schedules, and record their changes.
    ///
    /// # Returns
    /// The world after them.
    ///
    /// # Errors
    /// Those of [`StageWorld::build`].
    pub(crate) fn extend(
        &self,
        mut world: StageWorld,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let extensions = &self.generator.parameters.extensions;
        if let Some(count) = self.draw(extensions.removal, "REMOVAL") {
            world = self.remove(world, count, record)?;
        }
        if let Some(count) = self.draw(extensions.insertion, "INSERTION") {
            world = self.insert(world, count, record)?;
        }
        if let Some(count) = self.draw(extensions.openables, "OPENABLES") {
            world = self.open_objects(world, count, record)?;
        }
        if let Some(count) = self.draw(extensions.switches, "SWITCHES") {
            world = self.switch_objects(world, count, record)?;
        }
        if let Some(count) = self.draw(extensions.doors, "DOORS") {
            world = self.open_doors(world, count, record)?;
        }
        Ok(world)
    }

    /// Draw whether a process takes place; return the number of objects that it changes.
    fn draw(&self, occurrence: Option<Occurrence>, cause: &str) -> Option<usize> {
        let Occurrence { probability, max_count } = occurrence?;
        let mut stream = self.generator.stream(self.stage, &format!("{cause} trigger"));
        (stream.uniform() < probability).then(|| 1 + stream.below(max_count))
    }
}

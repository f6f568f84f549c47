//! What the fruits of the newest frames say against a pose that those before are for.
//!
//! Frames that are joined have their evidence together, and the newest one may have no part of it: a motion that was told
//! wrong lays the frames before where they were, and the newest fruits beside. So what these say for themselves has to
//! be above chance, under what is not known of the pose (`own`). What they say against a pose adds up from frame to frame,
//! until they have said as much for it. Until then the pose is not told, but kept, with what was learned of the motions, as
//! long as fruits can be looked for around it.

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Doubt {
    /// Evidence of the frames that doubt, nats; none is above zero.
    nats: f64,
    /// How many these are, the newest among them.
    frames: usize,
}

impl Doubt {
    /// After one more frame, whose own fruits have the evidence `own_nats`.
    pub fn after(&self, own_nats: f64) -> Self {
        let nats = self.nats + own_nats;
        if nats < 0.0 { Self { nats, frames: self.frames + 1 } } else { Self::default() }
    }

    /// Whether a pose is found under it.
    pub fn is_none(&self) -> bool {
        self.frames == 0
    }

    /// Whether the pose is as improbable as one that strangers have.
    pub fn is_sure(&self, false_alarm_rate: f64) -> bool {
        self.nats < false_alarm_rate.ln()
    }

    pub fn frames(&self) -> usize {
        self.frames
    }
}

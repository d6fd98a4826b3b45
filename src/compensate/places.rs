//! What is known of where the axes stand.

/// What is known of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Status {
    /// The program has not named it yet: it stands where it stands and is never written.
    Never,
    /// It stands at a place of the machine, or at one that is not known, until the program names it.
    Parked,
    /// The program has placed it.
    Placed,
}

/// What is known of all axes, in the order of the control's.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Places {
    status: Vec<Status>,
    /// Whether the program, or the set-up, has said where it stands.
    sure: Vec<bool>,
}

impl Places {
    /// No axis has been named.
    pub fn new(axes: usize) -> Self {
        Places { status: vec![Status::Never; axes], sure: vec![false; axes] }
    }

    pub fn len(&self) -> usize {
        self.status.len()
    }

    /// The program, or the set-up, says where the axis stands in program coordinates.
    pub fn place(&mut self, axis: usize) {
        (self.status[axis], self.sure[axis]) = (Status::Placed, true);
    }

    /// The axis goes to a place of the machine.
    pub fn park(&mut self, axis: usize) {
        (self.status[axis], self.sure[axis]) = (Status::Parked, false);
    }

    /// The place where the axis is parked is known after all.
    pub fn assure(&mut self, axis: usize) {
        self.sure[axis] = true;
    }

    /// Something else has moved the axis, if it has ever been placed.
    pub fn lose(&mut self, axis: usize) {
        self.sure[axis] = false;
        if self.status[axis] == Status::Placed {
            self.status[axis] = Status::Parked;
        }
    }

    /// Something else may have moved every axis.
    pub fn lose_all(&mut self) {
        (0..self.status.len()).for_each(|axis| self.lose(axis));
    }

    /// Whether the program has placed the axis, and nothing has moved it since.
    pub fn is_placed(&self, axis: usize) -> bool {
        self.status[axis] == Status::Placed
    }

    pub fn is_parked(&self, axis: usize) -> bool {
        self.status[axis] == Status::Parked
    }

    /// Whether some axis stands at a place of the machine.
    pub fn any_parked(&self) -> bool {
        self.status.contains(&Status::Parked)
    }

    /// Whether the program has ever named the axis.
    pub fn is_named(&self, axis: usize) -> bool {
        self.status[axis] != Status::Never
    }

    /// Whether it is known where the axis stands.
    pub fn is_sure(&self, axis: usize) -> bool {
        self.sure[axis]
    }

    /// [`Places::is_sure`] of every axis.
    pub fn sure(&self) -> &[bool] {
        &self.sure
    }
}

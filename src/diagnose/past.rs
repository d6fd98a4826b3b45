//! What all effects of a history at one joint share: columns of how it was before anybody looked and of their shapes, and the products of these.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::equations::{Column, Key};

/// Products of the columns of a history beside a field, each column of norm one.
pub(super) struct Past {
    pub answers: Vec<Column>,
    pub curves: Vec<Column>,
    /// Which answer and curve a column is made of, and by what it is multiplied.
    pub made_of: Vec<(usize, usize, f64)>,
    /// So many of the columns are of what was there before anybody looked, the others of the shape.
    pub before: usize,
    /// Gram matrix of the columns.
    pub own: DMatrix<f64>,
    /// What the marginal takes of them.
    pub along: DMatrix<f64>,
    /// The columns times the residuals that it leaves.
    pub toward: DVector<f64>,
}

/// By directions, joint, and whether it lasts.
pub(super) type Pasts = HashMap<(Vec<Key>, usize, bool), Arc<Past>>;

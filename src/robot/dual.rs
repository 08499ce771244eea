//! A scalar that carries its derivatives (forward-mode automatic differentiation).
//!
//! Everything tunable enters the chain's matrices linearly through such scalars (a stiffness, a mass, a damper), so the
//! derivatives of the matrices are exact and an effect gets its derivative by merely being written down.

use std::ops::{Add, Div, Mul, Sub};

/// Value and gradient with respect to the model's parameters. An empty gradient is that of a constant.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dual {
    /// The value itself.
    pub value: f64,
    /// Derivative with respect to each parameter; empty for a constant.
    pub gradient: Vec<f64>,
}

impl Dual {
    /// A value that depends on no parameter.
    pub fn constant(value: f64) -> Self {
        Dual {
            value,
            gradient: Vec::new(),
        }
    }

    /// The unit matrix of three coordinates.
    pub fn unit_matrix() -> [[Dual; 3]; 3] {
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| Dual::constant(if i == j { 1.0 } else { 0.0 })))
    }

    /// The parameter `index` of `count` itself.
    pub fn variable(value: f64, index: usize, count: usize) -> Self {
        let mut gradient = vec![0.0; count];
        gradient[index] = 1.0;
        Dual { value, gradient }
    }

    /// Derivative with respect to parameter `index`.
    pub fn derivative(&self, index: usize) -> f64 {
        self.gradient.get(index).copied().unwrap_or(0.0)
    }

    /// f(self) where `value` = f and `slope` = f' at `self.value`.
    pub fn chain(&self, value: f64, slope: f64) -> Self {
        Dual {
            value,
            gradient: self.gradient.iter().map(|g| g * slope).collect(),
        }
    }

    /// `factor` times this.
    pub fn scale(&self, factor: f64) -> Self {
        self.chain(self.value * factor, factor)
    }

    /// e to the power of this.
    pub fn exp(&self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }

    /// One over this.
    pub fn recip(&self) -> Self {
        self.chain(1.0 / self.value, -1.0 / (self.value * self.value))
    }

    /// The square root.
    pub fn sqrt(&self) -> Self {
        let value = self.value.sqrt();
        self.chain(value, 0.5 / value)
    }

    /// The absolute value.
    pub fn abs(&self) -> Self {
        self.scale(if self.value < 0.0 { -1.0 } else { 1.0 })
    }

    fn combine(&self, other: &Self, value: f64, left: f64, right: f64) -> Self {
        let count = self.gradient.len().max(other.gradient.len());
        let gradient = (0..count)
            .map(|i| left * self.derivative(i) + right * other.derivative(i))
            .collect();
        Dual { value, gradient }
    }
}

impl Add for &Dual {
    type Output = Dual;
    fn add(self, other: &Dual) -> Dual {
        self.combine(other, self.value + other.value, 1.0, 1.0)
    }
}

impl Sub for &Dual {
    type Output = Dual;
    fn sub(self, other: &Dual) -> Dual {
        self.combine(other, self.value - other.value, 1.0, -1.0)
    }
}

impl Mul for &Dual {
    type Output = Dual;
    fn mul(self, other: &Dual) -> Dual {
        self.combine(other, self.value * other.value, other.value, self.value)
    }
}

impl Div for &Dual {
    type Output = Dual;
    fn div(self, other: &Dual) -> Dual {
        let inverse = 1.0 / other.value;
        let value = self.value * inverse;
        self.combine(other, value, inverse, -value * inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let f = |x: &Dual, y: &Dual| &(&(x * y).exp() + &x.sqrt()) / &(y - x).abs();
        let (x0, y0) = (0.7, 1.9);
        let at = |x: f64, y: f64| f(&Dual::variable(x, 0, 2), &Dual::variable(y, 1, 2));
        let d = at(x0, y0);
        let h = 1e-6;
        let dx = (at(x0 + h, y0).value - at(x0 - h, y0).value) / (2.0 * h);
        let dy = (at(x0, y0 + h).value - at(x0, y0 - h).value) / (2.0 * h);
        assert!((d.derivative(0) - dx).abs() < 1e-7, "{} {dx}", d.derivative(0));
        assert!((d.derivative(1) - dy).abs() < 1e-7, "{} {dy}", d.derivative(1));
    }
}

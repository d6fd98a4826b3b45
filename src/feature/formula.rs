//! Expressions as formulas for people.

use std::fmt;

use super::Expression;

/// `-0.5 σ`, `sin(2π x/period)`: `x` position, `s` place within the travel seen, `σ` direction of travel, `v`, `a` velocity and
/// acceleration, `d` distance since the last reversal, `D` path, `τ` load by gravity, `τ₁` load of 1 kg at the end, `M`
/// and `Q` moment by gravity and how it changes along the axis, `λ` load of a first moment of 1 kg m, `t` time, `u`
/// place within the time seen; a prime marks the other joint of a pair.
impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write(self, f, 0, "")
    }
}

/// How tightly a formula holds together: 0 sum, 1 product, 2 quotient, 3 power, 4 a name.
fn binding(expression: &Expression) -> u8 {
    use Expression::*;
    match expression {
        Sum(list) if list.len() > 1 => 0,
        Difference(..) => 0,
        Product(list) if list.len() > 1 => 1,
        Turns(_) => 1,
        Quotient(..) => 2,
        Power(..) => 3,
        Partner(e) | Of(_, e) => binding(e),
        _ => 4,
    }
}

fn write(e: &Expression, f: &mut fmt::Formatter<'_>, at_least: u8, mark: &str) -> fmt::Result {
    use Expression::*;
    if binding(e) < at_least {
        f.write_str("(")?;
        write(e, f, 0, mark)?;
        return f.write_str(")");
    }
    let name = |f: &mut fmt::Formatter<'_>, name: &str| write!(f, "{name}{mark}");
    let call = |f: &mut fmt::Formatter<'_>, name: &str, e: &Expression| {
        write!(f, "{name}(")?;
        write(e, f, 0, mark)?;
        f.write_str(")")
    };
    let pair = |f: &mut fmt::Formatter<'_>, name: &str, (e, by): (&Expression, &Expression)| {
        write!(f, "{name}(")?;
        write(e, f, 0, mark)?;
        f.write_str("; ")?;
        write(by, f, 0, mark)?;
        f.write_str(")")
    };
    let list = |f: &mut fmt::Formatter<'_>, parts: &[Expression], between: &str, tight: u8| {
        for (i, part) in parts.iter().enumerate() {
            let sign = *part == Number(-1.0) && i == 0 && parts.len() > 1;
            match (i, sign) {
                (_, true) => {
                    f.write_str("-")?;
                    continue;
                }
                (0, _) => {}
                (1, _) if parts[0] == Number(-1.0) => {}
                _ => f.write_str(between)?,
            }
            write(part, f, tight, mark)?;
        }
        Ok(())
    };
    match e {
        TimeSince(_) | Time => f.write_str("t"),
        Number(value) => write!(f, "{value}"),
        Value(value, unit) => write!(f, "{value} {unit}"),
        Parameter(parameter) => f.write_str(parameter),
        Position => name(f, "x"),
        Stroke => name(f, "s"),
        Direction => name(f, "σ"),
        Late(by) => {
            f.write_str("(")?;
            name(f, "x")?;
            write!(f, " - {by} ")?;
            name(f, "v")?;
            f.write_str(")")
        }
        Velocity => name(f, "v"),
        Acceleration => name(f, "a"),
        SinceReversal => name(f, "d"),
        Travelled => name(f, "D"),
        Gravity => name(f, "τ"),
        Load => name(f, "τ₁"),
        Moment(n) => name(f, &format!("M{n}")),
        Shear(n) => name(f, &format!("Q{n}")),
        Lever(k, n) => name(f, &format!("λ{k}{n}")),
        Clock => f.write_str("u"),
        Beyond => f.write_str("u₊"),
        Order | OrderIn(_) => f.write_str("n"),
        Beginning | BeginningIn(_) => f.write_str("n₀"),
        Channel(channel, _) => f.write_str(channel),
        Only(_, e) => write(e, f, at_least, mark),
        Of(joint, e) => write(e, f, at_least, &format!("[{joint}]")),
        Partner(e) => write(e, f, at_least, "′"),
        Sum(parts) => list(f, parts, " + ", 1),
        Difference(first, second) => {
            write(first, f, 0, mark)?;
            f.write_str(" - ")?;
            write(second, f, 1, mark)
        }
        Product(parts) => list(f, parts, " ", 1),
        Quotient(above, below) => {
            write(above, f, 1, mark)?;
            f.write_str("/")?;
            write(below, f, 3, mark)
        }
        Power(e, n) => {
            write(e, f, 4, mark)?;
            write!(f, "^{n}")
        }
        Turns(e) => {
            f.write_str("2π ")?;
            write(e, f, 1, mark)
        }
        Sin(e) => call(f, "sin", e),
        Cos(e) => call(f, "cos", e),
        Exp(e) => call(f, "exp", e),
        Abs(e) => {
            f.write_str("|")?;
            write(e, f, 0, mark)?;
            f.write_str("|")
        }
        Sign(e) => call(f, "sign", e),
        Positive(e) => call(f, "positive", e),
        Step(e) => call(f, "step", e),
        Saturate(e) => call(f, "saturate", e),
        Bump(e) => call(f, "bump", e),
        Chebyshev(order, e) => call(f, &format!("T{order}"), e),
        Between(e, ..) => call(f, "between", e),
        Play(e) => call(f, &format!("play{mark}"), e),
        TakeUp(e) => call(f, &format!("takeup{mark}"), e),
        PlayOf(e, width) => pair(f, "play", (e, width)),
        Lag(e, time) => pair(f, "lag", (e, time)),
    }
}

#[cfg(test)]
mod tests {
    use super::Expression::*;

    #[test]
    fn formulas_read_as_one_would_write_them() {
        let period = || Box::new(Parameter("period".into()));
        let wave = Sin(Box::new(Turns(Box::new(Quotient(Box::new(Position), period())))));
        assert_eq!(wave.to_string(), "sin(2π x/period)");
        let decay = Product(vec![
            Number(-1.0),
            Direction,
            Exp(Box::new(Quotient(
                Box::new(Product(vec![Number(-1.0), SinceReversal])),
                Box::new(Parameter("decay".into())),
            ))),
        ]);
        assert_eq!(decay.to_string(), "-σ exp(-d/decay)");
        let pair = Product(vec![Stroke, Partner(Box::new(Stroke))]);
        assert_eq!(pair.to_string(), "s s′");
    }
}

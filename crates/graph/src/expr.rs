//! Whole-number expressions over sizes and parameters: reading and evaluation with checked arithmetic.

use crate::{
    diagnostics::Span,
    reader::{Reader, Spanned},
    registry::Expr,
    render::suggest,
    tree::{Kind, Tree},
};

/// An expression with the places of the names in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExprAt {
    /// The expression.
    pub expr: Expr,
    /// Every name it mentions.
    pub refs: Vec<ExprRef>,
    /// Where it stands.
    pub span: Span,
}

/// A name in an expression.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExprRef {
    /// What it must be.
    pub kind: RefKind,
    /// The name.
    pub name: Spanned,
    /// It divides: the greater it is, the smaller the result.
    pub divides: bool,
}

/// What a name in an expression stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RefKind {
    /// A parameter with whole numbers.
    Param,
    /// A texture (`Width`, `Height`).
    Texture,
    /// A buffer (`Elements`).
    Buffer,
    /// A condition with a name (`Holds`).
    Condition,
}

/// Where an expression gets its numbers from.
pub(crate) trait Scope {
    fn param(&self, name: &str) -> Option<i64>;
    fn output(&self) -> (u32, u32);
    fn texture(&self, name: &str) -> Option<(u32, u32)>;
    fn elements(&self, name: &str) -> Option<u64>;
    /// Whether the condition of a name holds, where there are any.
    fn holds(&self, name: &str) -> Option<bool>;
}

/// Why an expression has no value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum EvalError {
    /// A name has no size here; the reason is reported elsewhere.
    #[error("`{0}` has no size")]
    Unknown(String),
    #[error("the result does not fit in 64 bits")]
    Overflow,
    #[error("division by zero")]
    DivisionByZero,
    #[error("parameter `{0}` is {1}, and sizes are not negative")]
    Negative(String, i64),
}

pub(crate) fn eval(expr: &Expr, scope: &dyn Scope) -> Result<u64, EvalError> {
    let all = |list: &[Expr], first: u64, step: &dyn Fn(u64, u64) -> Option<u64>| {
        list.iter().try_fold(first, |sum, e| step(sum, eval(e, scope)?).ok_or(EvalError::Overflow))
    };
    match expr {
        Expr::Const(value) => Ok(*value),
        Expr::Param(name) => {
            let value = scope.param(name).ok_or_else(|| EvalError::Unknown(name.clone()))?;
            u64::try_from(value).map_err(|_| EvalError::Negative(name.clone(), value))
        }
        Expr::OutputWidth => Ok(scope.output().0.into()),
        Expr::OutputHeight => Ok(scope.output().1.into()),
        Expr::Width(name) => scope.texture(name).map(|size| size.0.into()).ok_or_else(|| EvalError::Unknown(name.clone())),
        Expr::Height(name) => scope.texture(name).map(|size| size.1.into()).ok_or_else(|| EvalError::Unknown(name.clone())),
        Expr::Elements(name) => scope.elements(name).ok_or_else(|| EvalError::Unknown(name.clone())),
        Expr::Holds(name) => scope.holds(name).map(u64::from).ok_or_else(|| EvalError::Unknown(name.clone())),
        Expr::Mul(list) => all(list, 1, &|a, b| a.checked_mul(b)),
        Expr::Add(list) => all(list, 0, &|a, b| a.checked_add(b)),
        Expr::Min(list) => all(list, u64::MAX, &|a, b| Some(a.min(b))),
        Expr::Max(list) => all(list, 0, &|a, b| Some(a.max(b))),
        Expr::DivCeil(a, b) | Expr::Div(a, b) => match eval(b, scope)? {
            0 => Err(EvalError::DivisionByZero),
            b if matches!(expr, Expr::Div(..)) => Ok(eval(a, scope)? / b),
            b => Ok(eval(a, scope)?.div_ceil(b)),
        },
        Expr::NextPowerOfTwo(a) => eval(a, scope)?.checked_next_power_of_two().ok_or(EvalError::Overflow),
    }
}

const FORMS: &[&str] = &[
    "Param",
    "Width",
    "Height",
    "Elements",
    "Holds",
    "Mul",
    "Add",
    "Min",
    "Max",
    "Div",
    "DivCeil",
    "NextPowerOfTwo",
    "OutputWidth",
    "OutputHeight",
];

/// Reads an expression.
pub(crate) fn read(reader: &mut Reader, tree: &Tree) -> Option<ExprAt> {
    let mut refs = Vec::new();
    let expr = read_into(reader, tree, &mut refs)?;
    Some(ExprAt { expr, refs, span: reader.span(&tree.range) })
}

fn read_into(reader: &mut Reader, tree: &Tree, refs: &mut Vec<ExprRef>) -> Option<Expr> {
    match &tree.kind {
        Kind::Number { .. } => {
            let value = reader.int(tree, "a whole number")?;
            let value = u64::try_from(value).ok();
            if value.is_none() {
                reader.error(&tree.range, "sizes and counts are not negative", "");
            }
            value.map(Expr::Const)
        }
        Kind::Name(name) if name == "OutputWidth" => Some(Expr::OutputWidth),
        Kind::Name(name) if name == "OutputHeight" => Some(Expr::OutputHeight),
        Kind::Tuple(Some(name), items) => {
            let text = name.text.as_str();
            match text {
                "Param" | "Width" | "Height" | "Elements" | "Holds" => {
                    let [item] = items.as_slice() else {
                        reader.error(&tree.range, format!("`{text}` takes one name"), format!("write `{text}(\"name\")`"));
                        return None;
                    };
                    let name = reader.text(item, "a name in quotes")?;
                    let (kind, expr): (_, fn(String) -> Expr) = match text {
                        "Param" => (RefKind::Param, Expr::Param),
                        "Width" => (RefKind::Texture, Expr::Width),
                        "Height" => (RefKind::Texture, Expr::Height),
                        "Holds" => (RefKind::Condition, Expr::Holds),
                        _ => (RefKind::Buffer, Expr::Elements),
                    };
                    let expr = expr(name.text.clone());
                    refs.push(ExprRef { kind, name, divides: false });
                    Some(expr)
                }
                "Mul" | "Add" | "Min" | "Max" => {
                    let [item] = items.as_slice() else {
                        reader.error(&tree.range, format!("`{text}` takes one list"), format!("write `{text}([a, b])`"));
                        return None;
                    };
                    let items = reader.list(item, "expressions");
                    if items.is_empty() && matches!(item.kind, Kind::List(_)) {
                        reader.error(&item.range, format!("`{text}` of nothing"), "name at least one term");
                        return None;
                    }
                    let terms: Vec<_> = items.iter().map(|item| read_into(reader, item, refs)).collect();
                    let terms: Vec<Expr> = terms.into_iter().collect::<Option<_>>().filter(|t: &Vec<Expr>| !t.is_empty())?;
                    Some(match text {
                        "Mul" => Expr::Mul(terms),
                        "Add" => Expr::Add(terms),
                        "Min" => Expr::Min(terms),
                        _ => Expr::Max(terms),
                    })
                }
                "Div" | "DivCeil" => {
                    let [a, b] = items.as_slice() else {
                        reader.error(&tree.range, format!("`{text}` takes two expressions"), format!("write `{text}(a, b)`"));
                        return None;
                    };
                    let a = read_into(reader, a, refs);
                    let divisor = refs.len();
                    let b = read_into(reader, b, refs);
                    refs.iter_mut().skip(divisor).for_each(|r| r.divides = !r.divides);
                    let (a, b) = (Box::new(a?), Box::new(b?));
                    Some(if text == "Div" { Expr::Div(a, b) } else { Expr::DivCeil(a, b) })
                }
                "NextPowerOfTwo" => {
                    let [a] = items.as_slice() else {
                        reader.error(&tree.range, "`NextPowerOfTwo` takes one expression", "write `NextPowerOfTwo(a)`");
                        return None;
                    };
                    Some(Expr::NextPowerOfTwo(Box::new(read_into(reader, a, refs)?)))
                }
                _ => {
                    reader.error(&name.range, format!("unknown expression `{text}`"), suggest(text, FORMS.iter().copied()));
                    None
                }
            }
        }
        Kind::Name(name) => {
            reader.error(&tree.range, format!("unknown expression `{name}`"), suggest(name, FORMS.iter().copied()));
            None
        }
        Kind::Text(name) => {
            reader.error(
                &tree.range,
                "expected a number or an expression, found a string",
                format!("write `Param(\"{name}\")` for a parameter"),
            );
            None
        }
        _ => {
            reader.expected(tree, "a number or an expression", "");
            None
        }
    }
}

fn main(){
 let m = kincal::Machine::parse("a.ron", r#"Machine(name:"ac", units:(length: mm, angle: deg), workpiece:[
 (frame:"a", at:(-158.5,2.93,-73.363), joint: Revolute(axis:"x")),(frame:"c", at:(0,-0.03,0.495), joint: Revolute(axis:"z")),(frame:"w", at:(158.5,-2.9,73.858))],
 tool:[(frame:"y", joint: Prismatic(axis:"y")),(frame:"x", joint: Prismatic(axis:"x")),(frame:"z", joint: Prismatic(axis:"-z")),(frame:"t", moves:[Rx(30),Tz(4)])])"#).map_err(|e| format!("{e} = {}", e.mend())).unwrap();
 println!("{}", m.to_ron());
 for c in kincal::check::check(&m, 50, 1) { println!("{:?}", c); }
}

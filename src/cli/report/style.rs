//! How a report looks, and the few lines that let its tables be sorted. Nothing is fetched from elsewhere.

/// Colours are those of Okabe and Ito, which colour-blind people tell apart; on dark ground their lighter ones.
pub(super) const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#1d1d1d;--soft:#595959;--ground:#fff;--line:#d6d6d6;--grid:#e6e6e6;--band:#f3e6c0;--card:#f6f6f6;\
--before:#d98e00;--after:#0072b2;--back:#c44e00;--fwd:#0072b2;--none:#6b6b6b;--curve:#000;--named:#007a5c}\
@media(prefers-color-scheme:dark){:root{--ink:#e8e8e8;--soft:#ababab;--ground:#161616;--line:#444;--grid:#333;--band:#4a3f1d;--card:#222;\
--before:#f0b43c;--after:#56b4e9;--back:#ff8a4c;--fwd:#56b4e9;--none:#a0a0a0;--curve:#fff;--named:#2fc79c}}\
*{box-sizing:border-box}body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--ground);max-width:66rem;margin:1.5rem auto;padding:0 1rem;overflow-wrap:anywhere}\
h1{font-size:1.5rem;margin:.2rem 0}h2{font-size:1.2rem;margin:2.4rem 0 .6rem;border-bottom:1px solid var(--line)}h3{font-size:1rem;margin:1.4rem 0 .4rem}\
p,li{max-width:46rem}.verdict{font-size:1.25rem;line-height:1.4;font-weight:600;margin:.8rem 0}.note,figcaption{color:var(--soft);font-size:.88rem}\
.card{background:var(--card);border:1px solid var(--line);border-radius:.4rem;padding:.2rem 1rem;margin:.8rem 0}ul.plain{list-style:none;padding:0;margin:.3rem 0}\
.card h2{margin-top:.8rem}ol.do li{margin:.5rem 0}code{font:.88em ui-monospace,monospace}\
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(27rem,100%),1fr));gap:1rem}\
.pair{display:grid;grid-template-columns:repeat(2,minmax(0,1fr));gap:1rem;max-width:44rem;margin:1rem 0}figure{margin:0;min-width:0}figure strong{color:var(--ink)}\
svg{display:block;width:100%;max-width:36rem;height:auto;margin:.3rem 0}svg text{fill:var(--ink);font:13px system-ui,sans-serif}svg .t{fill:var(--soft)}\
.pair svg{max-width:25rem}.pair svg text{font-size:16px}\
.legend span{display:inline-block;margin-right:1em;white-space:nowrap}.legend i{display:inline-block;width:.9em;height:.55em;margin-right:.35em;border-radius:2px}\
.grid{stroke:var(--grid);fill:none}.zero,.frame{stroke:var(--none);fill:none}.band{fill:var(--band)}\
.m-before{--c:var(--before)}.m-after{--c:var(--after)}.m-fwd{--c:var(--fwd)}.m-back{--c:var(--back)}.m-none{--c:var(--none)}.m-curve{--c:var(--curve)}.m-named{--c:var(--named)}.m-band{--c:var(--band)}\
.dots{stroke:var(--c);stroke-width:3;stroke-linecap:round;fill:none}.line{stroke:var(--c);stroke-width:1.5;stroke-linejoin:round;fill:none}.way{stroke-width:4}.bar{fill:var(--c)}.legend i{background:var(--c)}\
table{border-collapse:collapse;font-size:.9rem;margin:.6rem 0;max-width:100%}th,td{text-align:left;vertical-align:top;padding:.3rem .7rem;border-bottom:1px solid var(--line)}\
th,td{overflow-wrap:normal}td.long,.fold td.long{overflow-wrap:anywhere}td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}td.n{white-space:nowrap}.wide{overflow-x:auto}th button{font:inherit;font-weight:600;color:inherit;background:none;border:0;padding:0;cursor:pointer;text-align:inherit}\
th button:after{content:'\\a0\\2195';color:var(--soft);font-weight:400}th[aria-sort=ascending] button:after{content:'\\a0\\2191'}th[aria-sort=descending] button:after{content:'\\a0\\2193'}\
details{margin:.5rem 0;border:1px solid var(--line);border-radius:.4rem;padding:.3rem .8rem}summary{cursor:pointer;font-weight:600}\
@media screen and (max-width:44rem){body{margin:.6rem auto}table.fold,.fold tbody,.fold tr,.fold td{display:block;width:100%;max-width:30rem}.fold thead{display:none}\
.fold tr{border-bottom:2px solid var(--line);padding:.3rem 0}.fold td{border:0;padding:.1rem 0;display:flex;justify-content:space-between;gap:1rem;text-align:right;white-space:normal;overflow-wrap:anywhere}\
.fold td:before{content:attr(data-h);color:var(--soft);text-align:left;flex:none;max-width:45%}.fold td:empty{display:none}.pair{grid-template-columns:minmax(0,1fr)}}\
@media screen and (max-width:36rem){svg text{font-size:20px}}\
@media print{:root{color-scheme:light;--ink:#000;--soft:#333;--ground:#fff;--line:#bbb;--grid:#ddd;--band:#eee;--card:#fff;\
--before:#d98e00;--after:#0072b2;--back:#c44e00;--fwd:#0072b2;--none:#555;--curve:#000;--named:#007a5c}\
body{font-size:10pt;max-width:none;margin:0}figure,tr,.card,li{break-inside:avoid}h2,h3{break-after:avoid}th button:after{content:none}.figures{grid-template-columns:1fr 1fr}.wide{overflow:visible}}";

/// What is folded is printed. A click on a head sorts its table, once more the other way round.
pub(super) const SCRIPT: &str = "\
addEventListener('beforeprint',()=>document.querySelectorAll('details').forEach(d=>d.open=true));\
document.querySelectorAll('th button').forEach(b=>b.onclick=()=>{const h=b.parentNode,t=h.closest('table').tBodies[0],i=h.cellIndex,\
d=h.ariaSort==='ascending'?-1:1;[...h.parentNode.cells].forEach(c=>c.ariaSort=null);h.ariaSort=d>0?'ascending':'descending';\
const k=r=>{const c=r.cells[i];return c.dataset.v===undefined?c.textContent:+c.dataset.v};\
[...t.rows].sort((x,y)=>{const a=k(x),b=k(y);return d*(typeof a==='number'&&typeof b==='number'?a-b:String(a).localeCompare(String(b)))}).forEach(r=>t.append(r))})";

"""temporary"""
import time
from dataclasses import dataclass

import torch
from joblib import Parallel, delayed

from sidegan.seeds.lbfgs import BatchedLbfgs
from sidegan.seeds.objective import Penalty, value_and_gradient
from sidegan.seeds.problem import SeedProblem
from sidegan.validity import check


@dataclass
class Batch:
    coefficients: object; cpu: float; count:int
    def report(self): return {"count": self.count, "attempts": self.count, "failed": 0, "cpu_seconds": self.cpu}
def _opt(problem, phases, c):
    o=None
    for n,pen in phases:
        fun=lambda x,pen=pen:(lambda v,g:(v,g.flatten(1)))(*value_and_gradient(problem,x.view(-1,*problem.trajectory.shape),pen))
        if o is None: o=BatchedLbfgs(fun,c.flatten(1),memory=20)
        else: o.restart(fun)
        for _ in range(n): o.iterate()
    x=o.x.view(-1,*problem.trajectory.shape)
    for _ in range(40):
        v=check(problem.constraints,problem.trajectory,x)
        if v.valid.all(): break
        x=torch.where(v.valid[:,None,None,None],x,x*0.99)
    return x
def _task(cons,tr,n,seed,samples,steps):
    torch.set_num_threads(1); t=time.process_time()
    pr=SeedProblem(cons,tr,samples=samples); g=torch.Generator().manual_seed(seed)
    x=_opt(pr,[(int(steps*.7),Penalty(300)),(int(steps*.3),Penalty(10000,.015))],pr.start(n,g))
    return x,time.process_time()-t
def make_seeds(constraints,trajectory,settings,random,work,workers,progress):
    n=-(-settings.count//settings.batch); seeds=random.generate_state(n)
    out=[]; cpu=0
    for x,t in Parallel(workers,return_as="generator")(delayed(_task)(constraints,trajectory,settings.batch,int(s),64,settings.steps) for s in seeds):
        out.append(x); cpu+=t; progress(sum(map(len,out)),settings.count)
    return Batch(torch.cat(out)[:settings.count],cpu,settings.count)
def make_long(constraints,trajectory,samples,steps,seconds,random,progress):
    t=time.process_time(); pr=SeedProblem(constraints,trajectory,samples=samples); g=torch.Generator().manual_seed(int(random.generate_state(1)[0]))
    x=_opt(pr,[(int(steps*.7),Penalty(300)),(int(steps*.3),Penalty(10000,.015))],pr.start(1,g))
    return Batch(x,time.process_time()-t,1)
